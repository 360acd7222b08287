"""Meshes and arrangements are what the comments in their files say they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom


def read_mesh(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points and normals (n, 3) in the layer's space, quads (m, 4)."""
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    m = np.array(mesh.GetLocalTransformation())
    assert np.allclose(m[:3, :3], m[0, 0] * np.eye(3)), "normals would need another transform"
    points = np.array(mesh.GetPointsAttr().Get()) @ m[:3, :3] + m[3, :3]
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {4}
    quads = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 4)
    return points, np.array(mesh.GetNormalsAttr().Get()), quads


def require_outward(points: np.ndarray, normals: np.ndarray, quads: np.ndarray) -> None:
    """Faces are wound counter-clockwise about their normals."""
    a, b, c, d = (points[quads[:, i]] for i in range(4))
    face = np.cross(c - a, d - b)
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    assert (np.einsum("qj,qkj->qk", face, normals[quads]) > 0.5).all()


def test_ring(folder: Path) -> None:
    points, normals, quads = read_mesh(folder / "geometry" / "ring.usda")
    require_outward(points, normals, quads)
    radius, y = np.hypot(points[:, 0], points[:, 2]), points[:, 1]
    along = (points[:, 0] * normals[:, 0] + points[:, 2] * normals[:, 2]) / radius
    wall = along < -0.5
    # The wall: radius 1, normals to the axis. The bulge: an ellipse and its gradient.
    assert np.allclose(radius[wall], 1, atol=2e-4)
    assert np.allclose(along[wall], -1, atol=2e-3)
    x = (radius[~wall] - 1) / 0.12, y[~wall] / 0.22
    assert np.allclose(np.hypot(*x), 1, atol=2e-3)
    gradient = np.stack([x[0] / 0.12, x[1] / 0.22])
    gradient /= np.linalg.norm(gradient, axis=0)
    assert np.allclose([along[~wall], normals[~wall, 1]], gradient, atol=1e-2)
    # Every edge has two faces, but where wall and bulge meet, each with its own points.
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], -1).reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert np.count_nonzero(uses == 1) == 4 * 72


def test_ripples(folder: Path) -> None:
    # Amplitude and length in metres, direction in degrees, phase.
    waves = (
        (0.020, 1.30, 20, 0.3),
        (0.014, 0.95, 75, 1.7),
        (0.012, 0.75, -40, 4.1),
        (0.009, 0.60, 110, 2.9),
        (0.006, 0.52, 5, 5.2),
    )
    points, normals, quads = read_mesh(folder / "geometry" / "ripples.usda")
    require_outward(points, normals, quads)
    x, z = points[:, 0], points[:, 2]
    height, slope_x, slope_z = np.zeros((3, len(x)))
    for amplitude, length, degrees, phase in waves:
        k = 2 * np.pi / length
        kx, kz = k * np.cos(np.radians(degrees)), k * np.sin(np.radians(degrees))
        height += amplitude * np.sin(kx * x + kz * z + phase)
        slope_x += amplitude * kx * np.cos(kx * x + kz * z + phase)
        slope_z += amplitude * kz * np.cos(kx * x + kz * z + phase)
    expected = np.stack([-slope_x, np.ones_like(x), -slope_z], -1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.allclose(points[:, 1], height, atol=1e-4)
    assert np.allclose(normals, expected, atol=1e-3)


def test_water_covers_the_pool_and_its_walls_rise_above_it(folder: Path) -> None:
    stage = Usd.Stage.Open(str(folder / "pool.usda"))
    pool = stage.GetPrimAtPath("/World/Pool")
    for water in ("rippled", "flat"):
        pool.GetVariantSet("water").SetVariantSelection(water)
        cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
        surface, basin = (
            cache.ComputeWorldBound(
                stage.GetPrimAtPath(f"/World/Pool/{name}")
            ).ComputeAlignedRange()
            for name in ("Water", "Basin")
        )
        for axis in (0, 2):
            assert surface.min[axis] < basin.min[axis] < basin.max[axis] < surface.max[axis]
        assert basin.min[1] < surface.min[1] <= surface.max[1] < basin.max[1]


def test_sunflower(folder: Path) -> None:
    """Vogel 1979: seed n at the radius c √(n + 1/2) and n times the golden angle."""
    stage = Usd.Stage.Open(str(folder / "gallery.usda"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Sunflower"))
    positions = np.array(instancer.GetPositionsAttr().Get())
    n = np.arange(len(positions))
    angle = n * np.pi * (3 - np.sqrt(5))
    radius = 1.34 * np.sqrt(n + 0.5)
    outward = np.stack([np.cos(angle), np.zeros(len(n)), np.sin(angle)], -1)
    assert np.allclose(positions, radius[:, None] * outward, atol=6e-3)
    for seed, rotation in enumerate(instancer.GetOrientationsAttr().Get()):
        turned = Gf.Quatd(rotation).GetNormalized().Transform(Gf.Vec3d(1, 0, 0))
        assert np.allclose(turned, outward[seed], atol=5e-3)
    # They stand apart: none is wider than 2.1.
    distance = np.linalg.norm(positions[:, None] - positions, axis=-1)
    assert distance[~np.eye(len(n), dtype=bool)].min() > 1.8


def test_snow_falls_inside_the_globe(folder: Path) -> None:
    stage = Usd.Stage.Open(str(folder / "snow_globe.usda"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Snowfall"))
    positions = np.array(instancer.GetPositionsAttr().Get())
    assert len(positions) == len(instancer.GetProtoIndicesAttr().Get())
    assert np.linalg.norm(positions - (0, 7.2, 0), axis=1).max() + 0.08 < 5 * np.cos(np.pi / 48)
