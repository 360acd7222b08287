"""IES profiles in the core: directions, flux, samples and densities."""

import numpy as np
import pytest
from scipy import integrate, stats

from usdmlt import scene

VERTICAL = np.array([0.0, 20.0, 50.0, 80.0, 130.0])
HORIZONTAL = np.array([0.0, 90.0, 200.0, 360.0])
FACTORS = np.array([[5, 4, 2, 1, 0], [1, 6, 3, 2, 1], [2, 1, 8, 0, 3], [5, 4, 2, 1, 0.0]])
PROFILE = scene.IesProfile(VERTICAL, HORIZONTAL, FACTORS)
RADIUS = 0.3


def interpolated(theta, phi):
    """The profile at angles in radians: bilinear, 0 outside."""
    degrees, around = np.degrees(theta), np.degrees(phi) % 360
    rows = np.stack([np.interp(degrees, VERTICAL, row, right=0) for row in FACTORS])
    return np.array([np.interp(a, HORIZONTAL, rows[:, i]) for i, a in enumerate(around)])


def light(transform, cone=180.0):
    shaping = scene.Shaping(cone_angle_degrees=cone, ies=PROFILE)
    return scene.SphereLight((1.0, 1.0, 1.0), radius=RADIUS, transform=transform, shaping=shaping)


def directions_of(theta, phi, transform):
    """Emission towards vertical angle θ from -z; the azimuth is where it comes from."""
    local = np.stack(
        [-np.sin(theta) * np.cos(phi), -np.sin(theta) * np.sin(phi), -np.cos(theta)], 1
    )
    world = local @ transform[:3, :3]
    return (world / np.linalg.norm(world, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("kind", ["rigid", "mirrored"])
def test_the_radiance_is_the_file_s_at_the_angles_of_emission(placed, probe, kind):
    scale = (-1.0, 1.0, 1.0) if kind == "mirrored" else (1.0, 1.0, 1.0)
    transform = placed((0.7, -0.4, 1.1), scale=scale, position=(1.0, 2.0, 3.0))
    lights = probe(light(transform))
    random = np.random.default_rng(2)
    theta, phi = random.uniform(0, np.pi, 500), random.uniform(0, 2 * np.pi, 500)
    directions = directions_of(theta, phi, transform)
    # Of the point whose normal is the direction: the octahedral map of it in the light's space.
    n = directions @ np.linalg.inv(transform[:3, :3])
    p = n / np.abs(n).sum(axis=1, keepdims=True)
    folded = np.copysign(1 - np.abs(p[:, 1::-1]), p[:, :2])
    uv = np.where(n[:, 2:] < 0, folded, p[:, :2]).astype(np.float32)
    values = lights.radiance(lights.shape_point(0, uv), directions)[:, 0]
    np.testing.assert_allclose(values, interpolated(theta, phi), rtol=2e-3, atol=2e-3)


def solid_angle_integral(cone):
    """Of the profile over directions: around the axis it is linear in pieces."""
    theta = (np.arange(3000) + 0.5) / 3000 * np.radians(cone)
    around = integrate.trapezoid(FACTORS, np.radians(HORIZONTAL), axis=0)
    values = np.interp(np.degrees(theta), VERTICAL, around, right=0)
    return (values * np.sin(theta)).sum() * np.radians(cone) / 3000


@pytest.mark.parametrize("cone", [180.0, 60.0])
def test_the_flux_is_the_profile_s_integral(probe, cone):
    """Φ = ∫ L A⊥ dω with A⊥ = π r² for a sphere."""
    expected = np.pi * RADIUS**2 * solid_angle_integral(cone)
    assert probe(light(np.eye(4), cone)).power[0] == pytest.approx(expected, rel=3e-3)


def test_the_flux_of_samples_is_the_profile_s_integral(probe, uniform):
    """Φ = E[L cosθ / (p(x) p(ω))] over points and directions that light subpaths start with.

    At a significance of 1e-4; a factor wrong by 1 % would be seen.
    """
    lights = probe(light(np.eye(4)))
    n = 400_000
    points, pdf_point = lights.sample_point(uniform(n))
    directions, pdf = lights.sample_direction(points, uniform(n)[:, :2])
    cosine = (points["normal"] * directions).sum(axis=1)
    good = (pdf > 0) & (pdf_point > 0)
    value = np.zeros(n)
    emitted = lights.radiance(points, directions)[:, 0]
    value[good] = (emitted * cosine / np.where(good, pdf * pdf_point, 1))[good]
    error = value.std() / np.sqrt(n)
    expected = np.pi * RADIUS**2 * solid_angle_integral(180.0)
    assert error < 0.003 * expected
    assert abs(value.mean() - expected) < stats.norm.isf(0.5e-4) * error


def test_wherever_there_is_light_there_is_density(probe):
    """A beam of a fifth of a degree, narrower than the sampling's bins and between their points."""
    narrow = scene.IesProfile(
        np.array([0, 41.27, 41.3, 41.45, 41.48, 90.0]),
        np.array([0, 100.0, 101.0, 102.0, 360.0]),
        np.array([[0, 0, 0, 0, 0, 0], [0] * 6, [0, 0, 9, 9, 0, 0], [0] * 6, [0] * 6], float),
    )
    shaping = scene.Shaping(ies=narrow)
    lights = probe(scene.DiskLight((1.0, 1.0, 1.0), shaping=shaping))
    theta, phi = np.radians([41.4]), np.radians([101.0])
    direction = directions_of(theta, phi, np.eye(4))
    point = lights.shape_point(0, np.zeros((1, 2), np.float32))
    assert lights.radiance(point, direction)[0, 0] > 8
    assert lights.pdf_direction(point, direction)[0] > 0
