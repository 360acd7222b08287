"""Rays find the same set of points that is sampled."""

import numpy as np
import pytest

from support.rendering import build
from usdmlt import scene


def unit(v):
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def rays_to(points, distance, rng):
    """Rays from ``distance`` away that hit the emitting side."""
    n = points["normal"].astype(float)
    tangent = unit(np.cross(n, unit(rng.normal(size=n.shape))))
    away = unit(n + tangent * rng.uniform(-0.9, 0.9, (len(n), 1)))
    origin = (points["position"] + distance * away).astype(np.float32)
    return origin, unit(points["position"].astype(float) - origin).astype(np.float32)


@pytest.mark.parametrize("distance", [0.01, 0.3, 100.0])
def test_a_ray_towards_a_sampled_point_hits_it(surface, distance, probe, uniform):
    lights = probe(surface)
    points, _ = lights.sample_point(uniform(2000))
    a, b = surface.ab(points["uv"].astype(float))
    if surface.light.__class__.__name__ != "SphereLight":  # rays at the rim may pass beside it
        inside = (a > 1e-3) & (a < 1 - 1e-3) & (b > 1e-3) & (b < 1 - 1e-3)
        points = points[inside]
    origin, direction = rays_to(points, distance, np.random.default_rng(5))
    t, uv = lights.intersect_shape(0, origin, direction)
    assert np.isfinite(t).all()
    # Float directions end up to distance · 1e-7 beside the point; obliquely, some times that.
    tolerance = 2e-6 * (1 + distance)
    hit = lights.shape_point(0, uv)["position"]
    assert np.abs(hit - points["position"]).max() < 10 * tolerance
    assert t == pytest.approx(
        np.linalg.norm(points["position"] - origin, axis=1), abs=10 * tolerance
    )


@pytest.mark.parametrize("distance", [0.5, 1e4])
def test_parameters_of_a_hit_give_the_point_on_the_ray(surface, distance, probe, uniform):
    lights = probe(surface)
    points, _ = lights.sample_point(uniform(2000))
    origin, direction = rays_to(points, distance, np.random.default_rng(6))
    t, uv = lights.intersect_shape(0, origin, direction)
    hit = np.isfinite(t)
    assert hit.mean() > 0.8
    found = lights.shape_point(0, uv[hit])["position"]
    on_ray = origin[hit].astype(float) + t[hit, None].astype(float) * direction[hit]
    assert np.abs(found - on_ray).max() < 3e-6 + 3e-7 * distance


def test_distances_outside_the_range_are_no_hits(surface, probe, uniform):
    lights = probe(surface)
    points, _ = lights.sample_point(uniform(200))
    origin, direction = rays_to(points, 0.2, np.random.default_rng(7))
    t, _ = lights.intersect_shape(0, origin, direction)
    hit = np.isfinite(t)
    origin, direction, t = origin[hit], direction[hit], t[hit]
    shorter, _ = lights.intersect_shape(0, origin, direction, tfar=float(t.min()) * 0.99)
    assert np.isinf(shorter).all()
    later, _ = lights.intersect_shape(0, origin, direction, tnear=float(t.max()) * 1.01)
    assert (later[np.isfinite(later)] > t.max()).all()


def test_round_lights_are_hit_from_inside_too(families, probe):
    for name in ("sphere", "cylinder"):
        surface = families[name](np.eye(4), radius=0.5)
        t, _ = probe(surface).intersect_shape(
            0, np.zeros((1, 3), np.float32), np.array([[0, 0.6, 0.8]], np.float32)
        )
        assert t == pytest.approx(0.5)


def test_a_cylinder_has_no_caps(families, probe):
    surface = families["cylinder"](np.eye(4), radius=0.5, length=1.0)
    origin = np.array([[3, 0, 0], [3, 0.2, 0.1]], np.float32)
    direction = unit(np.array([[-1, 0, 0], [-1, 0.01, 0.0]])).astype(np.float32)
    t, _ = probe(surface).intersect_shape(0, origin, direction)
    assert np.isinf(t).all()


def test_a_tiny_sphere_far_away_is_hit_exactly_where_it_is(families, placed, probe):
    surface = families["sphere"](placed(position=(0, 0, -1000.0)), radius=0.01)
    lights = probe(surface)
    offsets = np.linspace(-0.02, 0.02, 41)
    origin = np.stack([offsets, 0 * offsets, 0 * offsets], 1).astype(np.float32)
    direction = np.array([[0, 0, -1]] * len(origin), np.float32)
    t, _ = lights.intersect_shape(0, origin, direction)
    inside = np.abs(origin[:, 0]) < 0.01
    assert np.array_equal(np.isfinite(t), inside)
    exact = 1000 - np.sqrt(0.01**2 - origin[inside, 0].astype(float) ** 2)
    assert t[inside] == pytest.approx(exact, rel=1.2e-7)


def test_bounds_hold_the_surface_tightly(surface, probe):
    lower, upper = (np.asarray(x, float) for x in probe(surface).shape_bounds(0))
    a, b = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201)))
    p = surface.world(a, b)
    assert (p.min(0) >= lower).all() and (p.max(0) <= upper).all()
    assert p.min(0) == pytest.approx(lower, abs=0.01) and p.max(0) == pytest.approx(upper, abs=0.01)


def test_positions_are_relative_to_the_center(family, placed, probe, uniform):
    far = np.array([1e7, -2e7, 3e7])
    u = uniform(100)
    here, _ = probe(family(placed((0.3, 0.1, 0.2)))).sample_point(u)
    there, _ = probe(family(placed((0.3, 0.1, 0.2), position=far)), center=tuple(far)).sample_point(
        u
    )
    assert np.array_equal(here["position"], there["position"])


def test_rays_meet_in_a_scene_what_each_shape_says(placed, probe):
    """Flat shapes that stay are triangles there, all others are asked: the nearest is met, with its
    number and its parameters; but for a few rays that touch an edge."""
    white = (1.0, 1.0, 1.0)
    rng = np.random.default_rng(8)

    def somewhere(**more):
        return placed(rng.uniform(-3, 3, 3), position=rng.uniform(-1, 1, 3), **more)

    lights = [
        scene.RectLight(white, 1.0, 2.0, somewhere()),
        scene.DiskLight(white, 0.7, somewhere()),
        scene.DiskLight(white, 0.4, somewhere(shear=0.5)),
        scene.RectLight(white, 1.5, 0.5, somewhere(shear=0.8)),
        scene.RectLight(white, 1.0, 1.0, somewhere(), motion=[somewhere()]),
        scene.SphereLight(white, 0.3, somewhere()),
        scene.RectLight(white, 0.6, 0.9, somewhere(scale=(1.0, 1.0, -1.0))),
    ]
    origins = unit(rng.normal(size=(20_000, 3))) * 6
    directions = unit(rng.uniform(-1.2, 1.2, origins.shape) - origins).astype(np.float32)
    met = build(scene.Scene(lights=lights)).intersect(origins, directions)

    one_by_one = [probe(light).intersect_shape(0, origins, directions) for light in lights]
    distances = np.array([t for t, _ in one_by_one])
    distance = distances.min(axis=0)
    nearest = np.where(np.isfinite(distance), distances.argmin(axis=0), -1)
    uv = np.choose(nearest[:, None], [uv for _, uv in one_by_one], mode="clip")
    assert {*nearest} == {-1, *range(len(lights))}
    assert (met["mesh"] == -1).all()
    same = met["triangle"] == nearest
    assert same.mean() > 0.9995
    hit = same & (nearest >= 0)
    np.testing.assert_allclose(met["distance"][hit], distance[hit], atol=5e-5)
    flat = hit & (nearest != 5)  # angles of a sphere jump
    np.testing.assert_allclose(met["uv"][flat], uv[flat], atol=2e-4)
