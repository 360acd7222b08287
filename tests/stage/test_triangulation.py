"""Triangulation keeps the area, the winding and the face of every polygon."""

from __future__ import annotations

import numpy as np
import pytest

from usdmlt.native import surfaces


def triangulate(points: np.ndarray, counts: np.ndarray, indices: np.ndarray):
    return surfaces().triangulate(points, counts, indices)


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Signed areas in the xy plane."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    u, v = b - a, c - a
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def polygon_area(points: np.ndarray) -> float:
    """The shoelace formula."""
    x, y = points[:, 0], points[:, 1]
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2


def star(corners: int, seed: int) -> np.ndarray:
    """A simple polygon around the origin, with many reflex corners."""
    random = np.random.default_rng(seed)
    angle = np.sort(random.uniform(0, 2 * np.pi, corners))
    radius = random.uniform(0.2, 1.0, corners)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)


L_SHAPE = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)], float)
DART = np.array([(0, 0, 0), (2, 1, 0), (0, 2, 0), (0.5, 1, 0)], float)


@pytest.mark.parametrize(
    "points",
    [L_SHAPE, DART, np.roll(DART, 1, axis=0), np.roll(DART, 2, axis=0), np.roll(DART, 3, axis=0)]
    + [star(corners, seed) for seed, corners in enumerate([5, 8, 13, 40, 200])],
)
@pytest.mark.parametrize("normal", ["x", "-x", "y", "-y", "z", "-z"])
def test_concave_polygons_keep_their_area_without_overlaps(points, normal):
    turned = np.roll(points, "xyz".index(normal[-1]) + 1, axis=1)
    if normal[0] == "-":
        points, turned = points[::-1], turned[::-1]
    corners, faces = triangulate(turned, np.array([len(points)]), np.arange(len(points)))
    assert len(corners) == len(points) - 2
    assert (faces == 0).all()
    signed = areas(points, corners)
    expected = polygon_area(points)
    # All triangles turn like the polygon and add up to it: none overlap, none stick out.
    assert (signed * np.sign(expected) >= -1e-12).all()
    assert signed.sum() == pytest.approx(expected, rel=1e-12)


def test_convex_polygons_are_fans_from_their_first_corner():
    angle = np.arange(6) * np.pi / 3
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    corners, _ = triangulate(points, np.array([6]), np.arange(6))
    assert corners.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]


def test_mixed_faces_stay_in_order_and_too_small_ones_vanish():
    counts = np.array([4, 2, 3, 0, 5, 1, 3])
    random = np.random.default_rng(5)
    corners, faces = triangulate(random.normal(size=(18, 3)), counts, np.arange(18))
    assert faces.tolist() == [0, 0, 2, 4, 4, 4, 6]
    starts = np.cumsum(counts) - counts
    assert (corners >= starts[faces][:, None]).all()
    assert (corners < (starts + counts)[faces][:, None]).all()


def test_triangles_pass_through_unchanged():
    corners, faces = triangulate(np.zeros((4, 3)), np.array([3, 3]), np.array([0, 1, 2, 2, 1, 3]))
    assert corners.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert faces.tolist() == [0, 1]


def test_a_polygon_with_a_bridge_to_its_hole_keeps_its_area():
    # A square with a square hole, joined by a bridge walked twice.
    outer = [(0, 0), (4, 0), (4, 4), (0, 4)]
    hole = [(1, 1), (1, 3), (3, 3), (3, 1)]
    ring = [*outer, outer[0], *hole, hole[0]]
    points = np.array([(x, y, 0) for x, y in ring], float)
    corners, _ = triangulate(points, np.array([len(ring)]), np.arange(len(ring)))
    signed = areas(points, corners)
    assert (signed >= 0).all()
    assert signed.sum() == pytest.approx(12)
