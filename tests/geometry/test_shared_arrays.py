"""The core keeps large arrays where they are."""

from __future__ import annotations

import gc
import sys

import numpy as np
import pytest

from support.rendering import build, rgba
from support.shapes import orthographic, scale
from usdmlt import scene as s


def scene_of(transform: np.ndarray) -> tuple[s.Scene, dict[str, np.ndarray]]:
    """A square whose halves have two materials that read a primvar."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    arrays = {
        "triangles": np.array([(0, 1, 2), (0, 2, 3)], np.int32),
        "values": np.array([(1, 0, 0), (0, 1, 0)], np.float32),
        "corners": np.array([(0, 0, 0), (1, 1, 1)], np.int32),
        "materials": np.array([0, 1], np.int32),
    }
    mesh = s.Mesh(
        corners,
        arrays["triangles"],
        primvars={"tint": s.Primvar(arrays["values"], arrays["corners"])},
        materials=arrays["materials"],
        transform=transform,
    )
    tint = s.PrimvarInput("tint", (0.0, 0.0, 0.0))
    materials = [s.Material(s.UniformEmission(tint)) for _ in range(2)]
    camera = orthographic((0, 0, 5), (0, 0, 0), 2, aspect=1)
    return s.Scene(camera, 8, 8, meshes=[mesh], materials=materials), arrays


@pytest.mark.parametrize("mirrored", [False, True])
def test_arrays_are_held_as_long_as_the_core_has_the_scene(mirrored: bool) -> None:
    """Indices of mirrored meshes are turned, and so copied."""
    scene, arrays = scene_of(scale(-1.0 if mirrored else 1.0, 1, 1))
    before = {name: sys.getrefcount(array) for name, array in arrays.items()}
    built = build(scene)
    held = {name: sys.getrefcount(array) - before[name] for name, array in arrays.items()}
    turned = 0 if mirrored else 1
    assert held == {"triangles": turned, "values": 1, "corners": turned, "materials": 1}
    picture = rgba(built, "path", samples=16, depth=1)[..., :3]
    lower, upper = picture[6, 5 if not mirrored else 2], picture[1, 2 if not mirrored else 5]
    assert (lower.tolist(), upper.tolist()) == ([1, 0, 0], [0, 1, 0])
    del built
    gc.collect()
    assert {name: sys.getrefcount(array) for name, array in arrays.items()} == before


def test_other_types_and_orders_are_copied() -> None:
    scene, _ = scene_of(np.eye(4))
    mesh = scene.meshes[0]
    expected = rgba(scene, "path", samples=4, depth=1)
    mesh.triangles = np.asfortranarray(mesh.triangles.astype(np.int64))
    mesh.primvars["tint"].values = mesh.primvars["tint"].values.astype(np.float64)[:, ::1]
    mesh.materials = np.repeat(mesh.materials, 2)[::2]
    np.testing.assert_array_equal(rgba(scene, "path", samples=4, depth=1), expected)
