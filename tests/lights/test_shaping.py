"""Shaping: focus, focusTint, cone and softness at chosen angles."""

import numpy as np
import pytest

from usdmlt import scene


def emitted(probe, families, placed, family, degrees, **shaping):
    """Radiance at angles from −z, from points whose normal is near −z."""
    transform = placed((0.7, -0.4, 1.1), position=(1.0, 2.0, 3.0))
    lights = probe(
        families[family](transform, radiance=(1.0, 2.0, 4.0), shaping=scene.Shaping(**shaping))
    )
    theta = np.radians(degrees)
    local = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], 1)
    directions = (local @ transform[:3, :3]).astype(np.float32)
    side = np.array([[0.0, 0.0]] if family == "disk" else [[0.5, 0.5]], np.float32)
    if family == "sphere":  # the point whose normal is local +x: lit from −90 to 90 degrees of it
        side = np.array([[1.0, 0.0]], np.float32)
    points = np.repeat(lights.shape_point(0, side), len(degrees))
    return lights.radiance(points, directions)


@pytest.mark.parametrize("family", ["rect", "disk", "sphere"])
def test_a_hard_cone_ends_at_its_angle(families, placed, probe, family):
    values = emitted(
        probe, families, placed, family, [1, 10, 29.99, 30.01, 60, 89], cone_angle_degrees=30.0
    )
    assert values[:, 1] == pytest.approx([2, 2, 2, 0, 0, 0])


def test_a_soft_cone_falls_off_by_smoothstep(families, placed, probe):
    """Between (1 − softness)·angle and angle: 1 − 3t² + 2t³."""
    values = emitted(
        probe,
        families,
        placed,
        "rect",
        [10, 20, 25, 30, 35, 39.9],
        cone_angle_degrees=40.0,
        cone_softness=0.5,
    )
    t = np.array([0, 0, 0.25, 0.5, 0.75, 0.995])
    assert values[:, 0] == pytest.approx(1 - 3 * t**2 + 2 * t**3, abs=1e-5)


def test_focus_is_a_power_of_the_cosine(families, placed, probe):
    degrees = np.array([0.0, 20.0, 45.0, 80.0])
    values = emitted(probe, families, placed, "disk", degrees, focus=3.0)
    cosine = np.cos(np.radians(degrees))
    assert values == pytest.approx(cosine[:, None] ** 3 * [1, 2, 4], rel=1e-5)


def test_focus_tint_is_what_remains_off_axis(families, placed, probe):
    degrees = np.array([0.0, 45.0, 85.0])
    tint = np.array([1.0, 0.5, 0.0])
    values = emitted(
        probe, families, placed, "rect", degrees, focus=2.0, focus_tint=tuple(tint.tolist())
    )
    f = np.cos(np.radians(degrees))[:, None] ** 2
    assert values == pytest.approx((tint + (1 - tint) * f) * [1, 2, 4], rel=1e-5, abs=1e-6)


def test_the_default_cone_halves_a_sphere(families, placed, probe):
    values = emitted(probe, families, placed, "sphere", [10, 89, 91, 150])
    assert values[:, 0] == pytest.approx([1, 1, 0, 0])
    plain, halved = (
        probe(families["sphere"](np.eye(4), shaping=s)).power[0] for s in (None, scene.Shaping())
    )
    assert halved == pytest.approx(plain / 2, rel=1e-3)


def test_a_cone_beyond_the_horizon_lets_a_sphere_shine_backwards(families, placed, probe):
    values = emitted(probe, families, placed, "sphere", [100, 170], cone_angle_degrees=180.0)
    assert values[:, 0] == pytest.approx([1, 1])


def test_a_flux_of_a_flat_cone_is_that_of_its_projected_solid_angle(families, probe):
    lights = probe(
        families["disk"](np.eye(4), radius=2.0, shaping=scene.Shaping(cone_angle_degrees=20.0))
    )
    expected = np.pi * 2**2 * np.pi * np.sin(np.radians(20)) ** 2
    assert lights.power[0] == pytest.approx(expected, rel=1e-3)


def test_a_cone_of_angle_zero_emits_nothing_and_is_never_chosen(families, probe, uniform):
    dark = families["disk"](np.eye(4), shaping=scene.Shaping(cone_angle_degrees=0.0))
    lights = probe(dark, families["disk"](np.eye(4)))
    assert lights.power[0] == 0
    points, _ = lights.sample_point(uniform(1000))
    assert (points["light"] == 1).all()
