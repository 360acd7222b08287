"""Lights that move are, at each time, lights that stay where they are carried."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from usdmlt import scene

FOCUSED = scene.Shaping(focus=2.0, cone_angle_degrees=70.0, cone_softness=0.3)


def carried(transform, time):
    """Turned about its own place by 80 degrees, and away: (1, −2, 0.5) in all."""
    result = transform.copy()
    turn = Rotation.from_rotvec(np.radians(80 * time) * np.array([0.6, 0.0, 0.8])).as_matrix()
    result[:3, :3] = transform[:3, :3] @ turn.T
    result[3, :3] += time * np.array([1.0, -2.0, 0.5])
    return result


def moving(light, steps=4):
    times = np.arange(1, steps + 1) / steps
    return replace(light, motion=[carried(light.transform, time) for time in times])


def still(light, time):
    return replace(light, transform=carried(light.transform, time))


TIMES = [0.0, 0.25, 0.75, 1.0]  # of the steps


@pytest.fixture
def transform(placed):
    """Stretched, sheared and mirrored."""
    return placed((0.2, 2.0, 0.3), (-1.0, 1.3, 0.7), 0.3, (0.5, -1.0, 0.0))


@pytest.mark.parametrize("time", TIMES)
def test_shapes_are_where_they_are_carried(family, transform, time, probe, uniform):
    light = family(transform, shaping=FOCUSED).light
    lights, expected = probe(moving(light)), probe(still(light, time))
    lights.time = time
    u = uniform(500)
    near = (carried(transform, time)[3, :3] + [0.2, -0.3, -1.5]).astype(np.float32)[None]
    for sample in (
        lambda p: p.sample_point(u),
        lambda p: p.sample_direct(near, u),
    ):
        (points, pdf), (others, other_pdf) = sample(lights), sample(expected)
        assert pdf == pytest.approx(other_pdf, rel=2e-4)
        seen = pdf > 0
        for name in ("position", "normal"):
            assert points[name][seen] == pytest.approx(others[name][seen], abs=2e-5)

    points, _ = lights.sample_point(u)
    others, _ = expected.sample_point(u)
    assert lights.pdf_direct(points, near) == pytest.approx(
        expected.pdf_direct(others, near), rel=2e-3, abs=1e-6
    )
    directions, pdf = lights.sample_direction(points, u[:, :2])
    assert lights.pdf_direction(points, directions) == pytest.approx(pdf, rel=1e-3)
    assert expected.pdf_direction(others, directions) == pytest.approx(pdf, rel=2e-2)
    assert lights.radiance(points, directions) == pytest.approx(
        expected.radiance(others, directions), rel=2e-3, abs=1e-5
    )

    # Rays find what was sampled.
    origin = points["position"] - directions.astype(np.float32) * 0.5
    distance, uv = lights.intersect_shape(0, origin, directions)
    other_distance, _ = expected.intersect_shape(0, origin, directions)
    agree = np.isfinite(distance) == np.isfinite(other_distance)
    assert agree.mean() > 0.99  # but for grazing ones
    hit = np.isfinite(distance) & agree
    assert hit.sum() > 100
    assert distance[hit] == pytest.approx(other_distance[hit], abs=1e-3)
    found = lights.shape_point(0, uv[hit])
    along = origin[hit] + directions[hit] * distance[hit, None]
    assert found["position"] == pytest.approx(along, abs=1e-4)


def test_between_steps_shapes_keep_their_size(surface, probe, uniform):
    lights = probe(moving(surface.light, steps=1))
    u = uniform(40)
    lights.time = 0.4
    points, pdf = lights.sample_point(u)
    lights.time = 0.0
    first, first_pdf = lights.sample_point(u)
    assert pdf == pytest.approx(first_pdf, rel=1e-6)

    def distances(p):
        return np.linalg.norm(p["position"][:, None] - p["position"][None], axis=-1)

    assert distances(points) == pytest.approx(distances(first), abs=1e-5)
    assert np.abs(points["position"] - first["position"]).max() > 0.1


def test_bounds_hold_at_all_times(surface, probe, uniform):
    lights = probe(moving(surface.light))
    lower, upper = lights.shape_bounds(0)
    for time in np.linspace(0, 1, 9):
        lights.time = time
        points, _ = lights.sample_point(uniform(500))
        assert (points["position"] >= lower).all()
        assert (points["position"] <= upper).all()


SKY = scene.Texture(np.random.default_rng(3).random((8, 16, 3)).astype(np.float32) ** 4)
TURNED = carried(np.eye(4), 0.3)
AT_INFINITY = {
    "dome": scene.DomeLight((1.0, 2.0, 3.0), 0, TURNED),
    "distant": scene.DistantLight((1.0, 2.0, 3.0), 40.0, TURNED),
    "sun": scene.DistantLight((1.0, 2.0, 3.0), 0.0, TURNED),
}


@pytest.mark.parametrize("time", TIMES)
@pytest.mark.parametrize("light", AT_INFINITY.values(), ids=AT_INFINITY)
def test_lights_at_infinity_turn(light, time, probe, uniform):
    lights = probe(moving(light), textures=[SKY])
    expected = probe(still(light, time), textures=[SKY])
    lights.time = time
    u = uniform(500)
    (points, pdf), (others, other_pdf) = lights.sample_point(u), expected.sample_point(u)
    if getattr(light, "angle_degrees", 0.0) == 0:  # a cone is sampled about its axis in any frame
        assert points["direction"] == pytest.approx(others["direction"], abs=2e-6)
    assert pdf == pytest.approx(other_pdf, rel=1e-3)
    assert lights.pdf_point(points) == pytest.approx(pdf, rel=1e-9)
    assert lights.radiance(points, points["direction"]) == pytest.approx(
        expected.radiance(others, others["direction"]), rel=1e-3
    )
    if lights.has_environment:
        everywhere = np.random.default_rng(5).normal(size=(500, 3))
        everywhere = (everywhere / np.linalg.norm(everywhere, axis=1)[:, None]).astype(np.float32)
        found, other = (p.environment_point(everywhere) for p in (lights, expected))
        assert lights.pdf_point(found) == pytest.approx(
            expected.pdf_point(other), rel=2e-3, abs=1e-6
        )
        assert lights.radiance(found, everywhere) == pytest.approx(
            expected.radiance(other, everywhere), rel=2e-3, abs=1e-4
        )


def test_of_two_environments_one_moves(probe, uniform):
    """Each is asked in its own frame."""
    dome, distant = AT_INFINITY["dome"], AT_INFINITY["distant"]
    lights = probe(moving(dome), distant, textures=[SKY])
    expected = probe(still(dome, 1.0), distant, textures=[SKY])
    lights.time = 1.0
    u = uniform(500)
    (points, pdf), (others, _) = lights.sample_point(u), expected.sample_point(u)
    assert points["direction"] == pytest.approx(others["direction"], abs=2e-6)
    assert expected.pdf_point(others) == pytest.approx(pdf, rel=1e-3)
    assert lights.radiance(points, points["direction"]) == pytest.approx(
        expected.radiance(others, others["direction"]), rel=1e-3
    )
