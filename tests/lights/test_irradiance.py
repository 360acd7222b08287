"""Closed-form irradiances by both ways of choosing points, within four standard errors."""

import numpy as np
import pytest

from usdmlt import scene

SAMPLES = 100_000
ORIGIN = np.zeros((1, 3), np.float32)


def irradiance(lights, strategy, u, normal=(0.0, 0.0, 1.0)):
    """Samples of ∫ L cosθ dω at the origin; ∫ L cosθ cosθ' / d² dA for surfaces."""
    if strategy == "direct":
        points, pdf = lights.sample_direct(ORIGIN, u)
    else:
        points, pdf = lights.sample_point(u)
    position = points["position"].astype(float)
    d2 = (position**2).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_light = np.where(
            points["infinite"][:, None], points["direction"], position / np.sqrt(d2)[:, None]
        )
        geometry = np.where(
            points["infinite"], 1.0, np.abs((to_light * points["normal"]).sum(1)) / d2
        )
        cosine = np.maximum(to_light @ np.asarray(normal, float), 0)
        emitted = lights.radiance(points, -to_light.astype(np.float32)).astype(float)
        value = emitted * (geometry * cosine / pdf)[:, None]
    return np.where((pdf > 0)[:, None], value, 0)


@pytest.fixture(params=["direct", "point"])
def strategy(request):
    return request.param


# Towards the origin from z = h: local −z is world −z.
def above(placed, h):
    return placed(position=(0.0, 0.0, h))


@pytest.mark.parametrize("height", [0.2, 0.7, 5.0])
def test_rect(height, strategy, placed, probe, uniform, assert_mean):
    """Form factor of a rectangle parallel to a receiver below its corner, four times."""
    light = scene.RectLight((1.0, 2.0, 3.0), 2.0, 1.2, above(placed, height))
    a, b = 1.0 / height, 0.6 / height
    factor = (
        4
        / (2 * np.pi)
        * (
            a / np.hypot(1, a) * np.arctan(b / np.hypot(1, a))
            + b / np.hypot(1, b) * np.arctan(a / np.hypot(1, b))
        )
    )
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.pi * factor * np.array([1, 2, 3]))


def test_rect_beside_the_receiver(strategy, placed, probe, uniform, assert_mean):
    """A rectangle perpendicular to the receiver, its lower corner on the ground."""
    # Local −z towards −x at x = 1, y and z from 0: width along y (2), height along z (1).
    transform = np.eye(4)
    transform[:3, :3] = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
    transform[3, :3] = (1.0, 1.0, 0.5)
    light = scene.RectLight((1.0, 1.0, 1.0), 2.0, 1.0, transform)
    # F = (atan Y − X-dependent part) / 2π for distance 1, width 2, height 1.
    width, height = 2.0, 1.0
    factor = (np.arctan(width) - np.arctan(width / np.hypot(1, height)) / np.hypot(1, height)) / (
        2 * np.pi
    )
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.full(3, np.pi * factor))


@pytest.mark.parametrize("height", [0.1, 1.0, 20.0])
def test_disk_on_its_axis(height, strategy, placed, probe, uniform, assert_mean):
    light = scene.DiskLight((1.0, 2.0, 3.0), 0.8, above(placed, height))
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.pi * 0.64 / (0.64 + height**2) * np.array([1, 2, 3]))


@pytest.mark.parametrize("distance", [1.01, 2.0, 50.0])
def test_sphere(distance, strategy, placed, probe, uniform, assert_mean):
    light = scene.SphereLight((1.0, 2.0, 3.0), 1.0, above(placed, distance))
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.pi / distance**2 * np.array([1, 2, 3]))


def test_sphere_that_is_half_below_the_horizon(strategy, placed, probe, uniform, assert_mean):
    """The nearest point sees the centre at the horizon: half of it, tilted."""
    light = scene.SphereLight((1.0, 1.0, 1.0), 1.0, placed(position=(2.0, 0.0, 0.0)))
    # ∫ of cosθ over the upper half of a cone of half-angle β about the horizon.
    beta = np.arcsin(0.5)
    expected = beta - np.sin(beta) * np.cos(beta)
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.full(3, expected))


def test_ellipsoid(strategy, placed, probe, uniform, assert_mean):
    """The cone that touches it is elliptical with slopes p, q: π p q / √((1 + p²)(1 + q²))."""
    a, b, c, distance = 0.5, 2.0, 3.0, 4.0
    light = scene.SphereLight(
        (1.0, 1.0, 1.0), 1.0, placed((0, 0, 0.5), (a, b, c), 0.0, (0, 0, distance))
    )
    p, q = np.array([a, b]) / np.sqrt(distance**2 - c**2)
    expected = np.pi * p * q / np.sqrt((1 + p * p) * (1 + q * q))
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.full(3, expected))


def test_long_cylinder(strategy, placed, probe, uniform, assert_mean):
    """An endless cylinder of radius r at distance d gives π L r / d; a long one, nearly."""
    light = scene.CylinderLight((1.0, 1.0, 1.0), 0.5, 400.0, above(placed, 2.0))
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.full(3, np.pi * 0.5 / 2.0))


@pytest.mark.parametrize("degrees", [0.53, 30.0, 180.0])
def test_distant(degrees, strategy, probe, uniform, assert_mean):
    """π sin² of the half-angle times the radiance: in lux where that is normalised."""
    sine2 = np.sin(np.radians(degrees / 2)) ** 2
    light = scene.DistantLight(tuple(1000 / (np.pi * sine2) * np.array([1.0, 2.0, 3.0])), degrees)
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, [1000, 2000, 3000])


def test_distant_without_an_angle(strategy, placed, probe, uniform):
    tilt = np.radians(60)
    light = scene.DistantLight((1.0, 2.0, 3.0), 0.0, placed((tilt, 0.0, 0.0)))
    samples = irradiance(probe(light), strategy, uniform(10))
    assert samples == pytest.approx(np.tile([0.5, 1.0, 1.5], (10, 1)), rel=1e-5)


def test_constant_dome(strategy, probe, uniform, assert_mean):
    light = scene.DomeLight((1.0, 2.0, 3.0))
    samples = irradiance(probe(light), strategy, uniform(SAMPLES))
    assert_mean(samples, np.pi * np.array([1, 2, 3]))


def test_constant_textured_dome(strategy, placed, probe, uniform, assert_mean):
    light = scene.DomeLight((1.0, 2.0, 3.0), 0, placed((0.5, 0.2, 0.9)))
    image = scene.Texture(np.full((5, 9, 3), 2.0, np.float16))
    samples = irradiance(probe(light, textures=[image]), strategy, uniform(SAMPLES))
    assert_mean(samples, 2 * np.pi * np.array([1, 2, 3]))


def test_many_lights_add_up(strategy, placed, probe, uniform, assert_mean):
    lights = probe(
        scene.SphereLight((8.0, 0.0, 0.0), 1.0, above(placed, 3.0)),
        scene.DiskLight((0.0, 5.0, 0.0), 1.0, above(placed, 2.0)),
        scene.DistantLight((0.0, 0.0, 1.0), 0.0),
        scene.DomeLight((0.1, 0.1, 0.1)),
        scene.RectLight((0.0, 0.0, 0.0)),
        radius=4.0,
    )
    samples = irradiance(lights, strategy, uniform(SAMPLES))
    dome = 0.1 * np.pi
    assert_mean(samples, [8 * np.pi / 9 + dome, np.pi + dome, 1 + dome])
