"""Optical depths and sampled collisions against quadrature and exact distributions.

Grids are interpolated here once more, by SciPy, and their integrals are sums over many thousand
points. Seen: a cell that is left out or counted twice, planes met in the wrong order, a border that
is half a cell off, a transform that is not the grid's, lengths in the wrong space, a body that is
entered from inside, collisions of another distribution than the one their density tells.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.interpolate import RegularGridInterpolator

from support.media_scenes import volume
from support.rendering import build
from support.shapes import box, rotate, scale, sphere, translate
from usdmlt import _core
from usdmlt import scene as s

SIGMA_S, SIGMA_A = np.array([0.7, 1.4, 0.2]), np.array([0.1, 0.0, 0.5])
SIGMA_T = SIGMA_S + SIGMA_A
LOWER, UPPER = np.array([-0.9, -0.6, -1.2]), np.array([0.7, 0.8, 1.0])
SHAPES = [(5, 4, 6), (1, 1, 1), (2, 7, 1), (16, 16, 16)]
PLACES = {
    "in place": np.eye(4),
    "turned and squeezed": scale(1.5, 0.4, -0.8) @ rotate((1, 2, 3), 50) @ translate(3, -2, 5),
}


def cells(shape: tuple[int, ...]) -> np.ndarray:
    values = np.random.default_rng(7).random(shape)
    return np.where(values > 0.25, values, 0).astype(np.float32)  # with holes


def grid_scene(values: np.ndarray, place: np.ndarray) -> s.Scene:
    bounds = box(LOWER, UPPER)
    medium = s.Medium(tuple(SIGMA_S), tuple(SIGMA_A), grid=s.Grid(values, LOWER, UPPER, place))
    return s.Scene(media=[medium], volumes=[s.Volume(bounds.points, bounds.triangles, 0, place)])


def density_of(values: np.ndarray, place: np.ndarray, points: np.ndarray) -> np.ndarray:
    """At points of the world: trilinear between centres, constant beyond them, 0 outside."""
    inverse = np.linalg.inv(place)
    local = (points @ inverse[:3, :3] + inverse[3, :3] - LOWER) / (UPPER - LOWER)
    n = np.array(values.shape)
    inside = ((local >= 0) & (local <= 1)).all(-1)
    padded = np.pad(values.astype(np.float64), 1, mode="edge")
    axes = [np.arange(-1, k + 1) for k in n]
    return np.where(inside, RegularGridInterpolator(axes, padded)(
        np.clip(local * n - 0.5, -1, n)), 0)  # fmt: skip


def quadrature(values, place, origins, directions, lengths, count: int = 6000) -> np.ndarray:
    """∫ density dt of rays, midpoints."""
    t = (np.arange(count) + 0.5) / count
    out = []
    for o, d, length in zip(origins, directions, lengths, strict=True):
        points = o + (t * length)[:, None] * d
        out.append(density_of(values, place, points).mean() * length)
    return np.array(out)


def rays(kind: str, place: np.ndarray, count: int = 40) -> tuple[np.ndarray, ...]:
    """Origins, unit directions and lengths in the world."""
    rng = np.random.default_rng(8)
    size = UPPER - LOWER
    start = LOWER - size + 3 * size * rng.random((count, 3))
    end = LOWER + size * rng.random((count, 3))
    if kind == "starting inside":
        start = LOWER + size * rng.random((count, 3))
    elif kind == "along axes":
        axis = rng.integers(0, 3, count)
        start = end.copy()
        start[np.arange(count), axis] -= (1 + rng.random(count)) * size[axis] * rng.choice([-1, 1])
    elif kind == "through edges":
        # Where cells meet, and the triangles of the box.
        n = 4
        end = LOWER + size * rng.integers(1, n, (count, 3)) / n
        start = end + size * rng.choice([-1, 1], (count, 3)) * 1.5
    through = kind in ("along axes", "through edges", "straight through")
    m, t = place[:3, :3], place[3, :3]
    start, end = start @ m + t, end @ m + t
    way = end - start
    lengths = np.linalg.norm(way, axis=1)
    return start, way / lengths[:, None], lengths * (2.5 if through else 1)


KINDS = ("straight through", "starting inside", "along axes", "through edges")


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("kind", KINDS)
def test_optical_depths_of_grids_are_integrals(kind: str, shape: tuple, place: str) -> None:
    values = cells(shape) if max(shape) > 1 else np.full(shape, 0.8, np.float32)
    ray = rays(kind, PLACES[place])
    depths, _ = _core.optical_depths(build(grid_scene(values, PLACES[place])), *ray)
    expected = quadrature(values, PLACES[place], *ray)[:, None] * SIGMA_T
    # Midpoints err by a 6000th of the way where the border is.
    assert (np.abs(depths - expected) <= 1e-3 * (1 + expected)).all()
    assert (expected.max(1) > 0.1).sum() > 8


def test_optical_depths_add_up_along_a_ray() -> None:
    """The parts of a ray have together what the ray has, wherever it is cut."""
    scene = build(grid_scene(cells((5, 4, 6)), PLACES["turned and squeezed"]))
    o, d, length = rays("straight through", PLACES["turned and squeezed"])
    whole, _ = _core.optical_depths(scene, o, d, length)
    for cut in (0.3, 0.5, 0.77):
        first, _ = _core.optical_depths(scene, o, d, cut * length)
        second, _ = _core.optical_depths(
            scene, o + cut * length[:, None] * d, d, (1 - cut) * length
        )
        np.testing.assert_allclose(first + second, whole, rtol=1e-4, atol=2e-5)


def nested() -> s.Scene:
    """A box, a ball of higher priority across its border, a smaller box within both, in a world."""
    media = [
        s.Medium((0.1,) * 3),
        s.Medium((0.5, 1.0, 2.0)),
        s.Medium((0.0,) * 3, (3.0, 2.0, 1.0)),
        s.Medium(),
    ]
    return s.Scene(
        media=media,
        world_medium=0,
        volumes=[
            volume(box((-1, -1, -1), (1, 1, 1)), 1),
            volume(box((0.4, -0.5, -0.5), (1.6, 0.5, 0.5)), 2, medium_priority=1),
            volume(box((0.6, -0.2, -0.2), (1.2, 0.2, 0.2)), 3, medium_priority=1),
        ],
    )


def test_bodies_in_each_other_count_by_priority_and_size() -> None:
    """Along x, through the middle: lengths in the four media, from different starts."""
    scene = build(nested())
    stretches = [  # from, to, medium
        (-3.0, -1.0, (0.1, 0.1, 0.1)),
        (-1.0, 0.4, (0.5, 1.0, 2.0)),
        (0.4, 0.6, (3.0, 2.0, 1.0)),
        (0.6, 1.2, (0.0, 0.0, 0.0)),
        (1.2, 1.6, (3.0, 2.0, 1.0)),
        (1.6, 4.0, (0.1, 0.1, 0.1)),
    ]
    for a, b in ((-3.0, 4.0), (-0.5, 4.0), (0.5, 0.55), (0.7, 1.4), (1.3, 3.0)):
        expected = sum(
            np.array(sigma) * max(0.0, min(b, end) - max(a, start))
            for start, end, sigma in stretches
        )
        for start, sign in ((a, 1), (b, -1)):
            depth, probability = _core.optical_depths(
                scene, [[start, 0.011, 0.017]], [[sign, 0, 0]], [b - a]
            )
            np.testing.assert_allclose(depth[0], expected, rtol=1e-5, atol=1e-6)
            stops = expected - sum(  # media that only absorb stop no ray
                np.array(sigma) * max(0.0, min(b, end) - max(a, first))
                for first, end, sigma in stretches if sigma[0] == 3.0
            )  # fmt: skip
            assert probability[0] == pytest.approx(np.exp(-stops).mean(), rel=1e-5)


@pytest.mark.parametrize("inside", [True, False])
def test_a_ball_of_many_triangles_is_left_once(inside: bool) -> None:
    """Rays through edges and vertices of its mesh too; the depth is the chord by all of them."""
    ball = sphere(1.0, rings=16)
    scene = build(s.Scene(media=[s.Medium((1.0,) * 3)], volumes=[volume(ball, 0)]))
    points = ball.points.astype(np.float64)
    triangles = points[ball.triangles]
    targets = np.concatenate([points, (triangles[:, 0] + triangles[:, 1]) / 2])
    start = np.array([0.05, -0.1, 0.02]) if inside else np.array([3.0, 1.0, -2.0])
    way = targets - start
    directions = way / np.linalg.norm(way, axis=1)[:, None]
    depths, _ = _core.optical_depths(scene, [start], directions, np.full(len(targets), 10.0))
    if inside:
        np.testing.assert_allclose(depths[:, 0], np.linalg.norm(way, axis=1), rtol=1e-4)
    else:
        # The chord of a unit ball, a little less of a polyhedron. What touches its outline is left
        # out: edges are met there without entering.
        closest = np.linalg.norm(np.cross(start, directions), axis=1)
        through = closest < 0.9
        chord = 2 * np.sqrt(1 - closest[through] ** 2)
        assert (depths[through, 0] <= chord + 1e-5).all()
        assert (depths[through, 0] > chord - 0.06).all()


# ---- Collisions -------------------------------------------------------------------------------

COUNT = 20_000
SIGNIFICANCE = 1e-4


def require_distribution(scene: object, origin, direction, length: float, seed: int) -> None:
    """Kolmogorov and Smirnov: distances t have the distribution 1 − ⅓ Σ_c e^{−τ_c(t)} up to the
    end, which the rest reaches."""
    t = _core.collisions(scene, [origin], [direction], length, COUNT, seed)
    stopped = np.sort(t[np.isfinite(t)])
    at = np.linspace(0, length, 4001)
    _, through = _core.optical_depths(
        scene, np.broadcast_to(origin, (at.size, 3)), np.broadcast_to(direction, (at.size, 3)), at
    )
    share = 1 - through[-1]
    assert stopped.size > 1000
    assert stats.binomtest(stopped.size, COUNT, share).pvalue >= SIGNIFICANCE
    cdf = (1 - through) / share
    result = stats.kstest(stopped, lambda x: np.interp(x, at, cdf))
    assert result.pvalue >= SIGNIFICANCE


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_collisions_in_grids_have_the_distribution_of_their_density(shape, place) -> None:
    values = cells(shape) + np.float32(0.5)
    scene = build(grid_scene(values, PLACES[place]))
    for kind in ("straight through", "starting inside"):
        o, d, length = rays(kind, PLACES[place], 3)
        for i in range(3):
            require_distribution(scene, o[i], d[i], 3 * length[i], seed=i)


@pytest.mark.parametrize("start", [-3.0, -0.2, 0.7])
def test_so_do_those_in_bodies_within_each_other(start: float) -> None:
    require_distribution(build(nested()), (start, 0.011, 0.017), (1, 0, 0), 4 - start, seed=4)


def test_collisions_are_where_the_density_is() -> None:
    """Against the exact distribution of one channel: e^{−σt}."""
    scene = build(s.Scene(media=[s.Medium((0.8,) * 3, (0.4,) * 3)], world_medium=0))
    t = _core.collisions(scene, [[1, 2, 3]], [[0, 0, 1]], 1e30, COUNT, 5)
    assert stats.kstest(t, stats.expon(scale=1 / 1.2).cdf).pvalue >= SIGNIFICANCE


def test_nothing_collides_where_nothing_scatters() -> None:
    scene = build(s.Scene(media=[s.Medium(absorption=(5.0,) * 3)], world_medium=0))
    assert np.isinf(_core.collisions(scene, [[0, 0, 0]], [[0, 0, 1]], 10, 1000)).all()
