"""The scenes render, and both integrators make the same of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from support import eased
from support.eased import EASED
from support.rendering import BOTH, build, picture, pictures
from support.statistics import agreement
from usdmlt.stage import load

WIDTH = 32


@pytest.mark.parametrize("integrator", BOTH)
def test_a_scene_renders_to_a_finite_picture_with_light_in_it(
    scene_path: Path, integrator: str
) -> None:
    # These are dark but for one path in some thousands, and path tracing finds no lamp in glass.
    samples = 256 if scene_path.stem in ("small_aperture",) else 8
    stage = (
        scene_path
        if scene_path.stem != "keyhole"
        else eased.open_scene("keyhole", EASED["keyhole"])
    )
    got = picture(load(stage, width=WIDTH), integrator, samples=samples)
    assert np.isfinite(got).all()
    assert got.min() >= 0
    assert 0.02 < got.mean() < 3


SAMPLES = {"cornell_box": 16, "gallery": 32, "pool": 32}  # others: 64


def require_equal_means(stage: Usd.Stage, samples: int, seeds: int, resolution: float) -> None:
    """Welch's t-test of the mean at the significance 10⁻³, lights seen directly left out.

    Pixels are not compared: with so few samples their distributions have tails that no t-test
    allows for. ``resolution``: the largest standard error of the relative difference.
    """
    scene = build(load(stage, width=WIDTH))
    settings = {"samples": samples, "depth": 8, "min_edges": 2}
    result = agreement(
        pictures(scene, "path", seeds, **settings),
        pictures(scene, "bdpt", range(1000, 1000 + seeds), **settings),
    )
    assert result.resolution < resolution, f"too noisy to tell: {result}"
    assert result.mean > 1e-3, f"means differ: {result}"


@pytest.mark.parametrize("name", EASED)
def test_path_and_bdpt_agree_in_the_mean(name: str, open_scene: Callable[..., Usd.Stage]) -> None:
    samples = SAMPLES.get(name, 64)
    require_equal_means(open_scene(name, EASED[name]), samples, seeds=12, resolution=0.03)


# Not the pool: the sun is found through the water once in 10⁵ samples, by either integrator.
AS_SHIPPED = {"caustics": 768, "door_ajar": 192, "small_aperture": 768, "snow_globe": 512}


@pytest.mark.slow
@pytest.mark.parametrize("name", AS_SHIPPED)
def test_path_and_bdpt_agree_on_the_scene_as_it_ships(
    name: str, open_scene: Callable[..., Usd.Stage]
) -> None:
    require_equal_means(open_scene(name), AS_SHIPPED[name], seeds=16, resolution=0.04)


@pytest.mark.parametrize("water", ["rippled", "flat"])
def test_the_pool_has_two_kinds_of_water(water: str, open_scene: Callable[..., Usd.Stage]) -> None:
    """Light from the sky on a point of the floor passes either; still water bends no tiles."""
    stage = open_scene("pool", {"/World/Lights/Sun": False})
    stage.GetPrimAtPath("/World/Pool").GetVariantSet("water").SetVariantSelection(water)
    scene = load(stage, width=WIDTH)
    (surface,) = (mesh for mesh in scene.meshes if mesh.name.endswith("/Water"))
    assert (len(surface.triangles) == 2) == (water == "flat")
    assert picture(scene, samples=64).min() > 0


# ---------------------------------------------------------------------------------------------
# Light goes only where the scenes say.


def test_nothing_behind_the_ajar_door_is_lit_directly(
    open_scene: Callable[..., Usd.Stage],
) -> None:
    """Seen from beside the door: no path of one or two edges, and some of three."""
    camera = {
        "xformOp:translate": (-0.4, 1.5, -1.9),
        "xformOp:rotateXYZ": (-10, 180, 0),
        "focalLength": 12,
    }
    changes = {f"/World/main_cam.{name}": value for name, value in camera.items()}
    scene = load(open_scene("door_ajar", changes), width=64)
    assert not picture(scene, "bdpt", samples=64, depth=2).any()
    assert picture(scene, "bdpt", samples=64, min_edges=3, depth=3).any()


# The opening and what closes it: (centre, size).
OPENINGS = {
    "door_ajar": ((0.95, 1.0, -2.06), (0.94, 2.2, 0.08)),
    "keyhole": ((-1.5, 1.25, -0.2), (0.02, 0.24, 0.14)),
    "small_aperture": ((0.0, 1.1, 1.505), (0.06, 0.06, 0.02)),
}


@pytest.mark.parametrize("name", OPENINGS)
def test_a_room_with_its_opening_closed_is_dark(
    name: str, open_scene: Callable[..., Usd.Stage]
) -> None:
    """No light leaks in at edges and corners: 30 000 paths each from the camera and the lights."""
    scene = load(open_scene(name, boxes=(OPENINGS[name],)), width=WIDTH)
    assert not picture(scene, "bdpt", samples=50).any()
