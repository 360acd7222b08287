"""Lights at infinity: domes, distant lights, and their mixture."""

import numpy as np
import pytest

from usdmlt import scene

SAMPLES = 100_000


def unit(v):
    v = np.asarray(v, float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def sphere_directions(n, seed=1):
    return unit(np.random.default_rng(seed).normal(size=(n, 3))).astype(np.float32)


def sky(width=16, height=8, seed=2):
    """A noisy image with a sun a thousand times brighter, and black parts."""
    pixels = np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)
    pixels[height // 3, width // 4] = 1000
    pixels[(height + 1) // 2 :, (width + 1) // 2 :] = 0
    return scene.Texture(pixels)


def luminance(colors):
    return np.asarray(colors, float) @ [0.2126, 0.7152, 0.0722]


# --- domes


def test_the_image_of_a_dome_has_its_centre_at_z_and_its_top_at_y(probe):
    """Row 0 is +y, the centre column +z, a quarter from the left +x."""
    pixels = np.zeros((65, 128, 3), np.float32)
    pixels[..., 0] = ((np.arange(128) + 0.5) / 128)[None, :]
    pixels[..., 1] = ((np.arange(65) + 0.5) / 65)[:, None]
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), texture=0), textures=[scene.Texture(pixels)])
    directions = unit([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 1, 1]])
    points = lights.environment_point(directions.astype(np.float32))
    s, t, _ = lights.radiance(points, directions).T
    assert s[[0, 1, 2, 5]] == pytest.approx([0.5, 0.25, 0.75, 0.5], abs=1e-5)
    assert t == pytest.approx([0.5, 0.5, 0.5, 0, 1, 0.25], abs=0.5 / 65 + 1e-5)


def test_the_image_of_a_dome_continues_across_its_left_and_right_edge(probe):
    pixels = np.zeros((4, 8, 3), np.float32)
    pixels[:, 0], pixels[:, -1] = 1, 3
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), texture=0), textures=[scene.Texture(pixels)])
    seam = np.array([[0, 0, -1]], np.float32)
    assert lights.radiance(lights.environment_point(seam), seam) == pytest.approx(2, abs=1e-4)


def test_a_dome_turns_with_its_transform(placed, probe):
    transform = placed((0.4, 1.0, -0.3), position=(5.0, 6.0, 7.0))
    image = sky()
    still = probe(scene.DomeLight((1.0, 2.0, 3.0), texture=0), textures=[image])
    turned = probe(scene.DomeLight((1.0, 2.0, 3.0), 0, transform), textures=[image])
    local = sphere_directions(1000)
    world = (local @ transform[:3, :3]).astype(np.float32)
    expected = still.radiance(still.environment_point(local), local)
    found = turned.radiance(turned.environment_point(world), world)
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("shape", [(16, 8), (1, 1), (2, 1), (7, 5)])
def test_directions_of_a_dome_are_distributed_as_their_density(
    shape, placed, probe, uniform, direction_grid, assert_distributed_as
):
    transform = placed((0.4, 1.0, -0.3))
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), 0, transform), textures=[sky(*shape, seed=4)])
    points, pdf = lights.sample_point(uniform(SAMPLES))
    assert (pdf > 0).mean() > 0.9999
    grid = direction_grid(transform[1, :3])
    masses = grid.masses(lambda d: lights.pdf_point(lights.environment_point(d)), order=20)
    assert masses.sum() == pytest.approx(1, abs=2e-3)
    assert_distributed_as(grid.counts(points["direction"]), masses, SAMPLES)


def test_directions_of_a_sheared_dome_are_distributed_as_their_density(
    placed, probe, uniform, direction_grid, assert_distributed_as
):
    transform = placed((0.4, 1.0, -0.3), (1.0, 2.0, -0.7), 0.3)
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), 0, transform), textures=[sky()])
    points, _ = lights.sample_point(uniform(SAMPLES))
    grid = direction_grid((0.0, 0.0, 1.0))
    masses = grid.masses(lambda d: lights.pdf_point(lights.environment_point(d)), order=20)
    assert masses.sum() == pytest.approx(1, abs=2e-3)
    assert_distributed_as(grid.counts(points["direction"]), masses, SAMPLES)


def test_the_density_of_a_dome_follows_its_radiance(probe, uniform):
    """Bilinear like the radiance: L/p varies only by sinθ across a texel, even around a sun."""
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), texture=0), textures=[sky(64, 32)])
    points, pdf = lights.sample_point(uniform(SAMPLES))
    weight = luminance(lights.radiance(points, points["direction"])) / pdf
    assert weight.std() < 0.05 * weight.mean()


def test_wherever_a_dome_shines_it_has_a_density(probe):
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), texture=0), textures=[sky()])
    directions = sphere_directions(50_000)
    points = lights.environment_point(directions)
    shines = luminance(lights.radiance(points, directions)) > 0
    assert 0.3 < shines.mean() < 1
    assert (lights.pdf_point(points)[shines] > 0).all()


def test_dim_parts_beside_a_sun_keep_their_density(probe, uniform):
    """A sun of 1e6 in one texel of 512 × 256: the rest of the sky is still sampled correctly."""
    pixels = np.full((256, 512, 3), 0.5, np.float32)
    pixels[40, 77] = 1e6
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), texture=0), textures=[scene.Texture(pixels)])
    points, pdf = lights.sample_point(uniform(SAMPLES))
    value = luminance(lights.radiance(points, points["direction"])) / pdf
    dim = luminance(lights.radiance(points, points["direction"])) < 0.6
    share = 0.5 * 4 * np.pi / value.mean()
    assert dim.mean() == pytest.approx(share, abs=5 * np.sqrt(share / SAMPLES))
    assert value[dim].min() > 0.98 * value.mean() and value[dim].max() < 1.02 * value.mean()


def test_a_black_dome_is_no_environment(probe, uniform):
    lights = probe(
        scene.DomeLight((1.0, 1.0, 1.0), texture=0),
        textures=[scene.Texture(np.zeros((4, 8, 3), np.float32))],
    )
    assert not lights.has_environment
    assert (lights.sample_point(uniform(10))[1] == 0).all()


def test_a_sun_beyond_the_range_of_the_image_leaves_the_rest_of_the_dome_alone(probe, uniform):
    pixels = np.full((16, 32, 3), 0.5, np.float32)
    pixels[3, 7], pixels[9, 9] = np.inf, np.nan
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), texture=0), textures=[scene.Texture(pixels)])
    _, pdf = lights.sample_point(uniform(10_000))
    assert (pdf > 0).mean() > 0.999
    assert np.isfinite(pdf).all()
    assert lights.power[0] == pytest.approx(np.pi * 4 * np.pi * 0.5, rel=0.02)


# --- distant lights


@pytest.mark.parametrize("degrees", [0.01, 0.53, 20.0, 180.0, 300.0, 360.0])
def test_a_distant_light_fills_its_cone_about_z(degrees, placed, probe, uniform, assert_mean):
    transform = placed((0.3, 0.8, 0.2))
    lights = probe(scene.DistantLight((3.0, 3.0, 3.0), degrees, transform))
    points, pdf = lights.sample_point(uniform(SAMPLES))
    assert points["infinite"].all() and not points["delta"].any()
    found = pdf > 0
    assert found.mean() > 0.999
    one_minus_cos = 2 * np.sin(np.radians(degrees) / 4) ** 2
    assert pdf[found] == pytest.approx(1 / (2 * np.pi * one_minus_cos))
    # The sampled 1 − cosθ is uniform over the cone.
    offset = points["direction"].astype(float) - unit(transform[2, :3])
    assert_mean((0.5 * (offset**2).sum(1))[found], 0.5 * one_minus_cos)


def test_radiance_ends_at_the_cone(placed, probe):
    transform = placed((0.3, 0.8, 0.2))
    lights = probe(scene.DistantLight((3.0, 2.0, 1.0), 10.0, transform))
    theta = np.radians([0, 4.99, 5.01, 170, 180])
    local = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], 1)
    directions = (local @ transform[:3, :3]).astype(np.float32)
    found = lights.radiance(lights.environment_point(directions), directions)
    assert found == pytest.approx(np.array([[3, 2, 1]] * 2 + [[0, 0, 0]] * 3))


def test_a_distant_light_of_angle_zero_is_dirac(placed, probe, uniform):
    transform = placed((0.3, 0.8, 0.2))
    lights = probe(scene.DistantLight((3.0, 2.0, 1.0), 0.0, transform), radius=2.0)
    points, pdf = lights.sample_direct(np.zeros((1, 3), np.float32), uniform(100))
    assert points["delta"].all() and points["infinite"].all()
    assert (pdf == 1).all() and (lights.pdf_point(points) == 1).all()
    assert points["direction"] == pytest.approx(np.tile(transform[2, :3], (100, 1)), abs=1e-6)
    assert lights.radiance(points, -points["direction"])[0] == pytest.approx([3, 2, 1])
    assert not lights.has_environment


# --- together


def test_the_environment_is_the_mixture_of_its_lights(
    placed, probe, uniform, direction_grid, assert_distributed_as
):
    transform = placed((0.3, 0.8, 0.2))
    dome = scene.DomeLight((0.2, 0.3, 0.4), 0, placed((1.0, 0.0, 0.5)))
    distant = scene.DistantLight((30.0, 20.0, 10.0), 40.0, transform)
    images = [scene.Texture(np.random.default_rng(3).random((6, 12, 3)).astype(np.float32))]
    lights = probe(dome, distant, scene.DistantLight((1.0, 1.0, 1.0), 0.0), textures=images)
    alone = [probe(dome, textures=images), probe(distant)]

    directions = np.concatenate(
        [sphere_directions(1000), alone[1].sample_point(uniform(1000))[0]["direction"]]
    )
    points = lights.environment_point(directions)
    both = sum(p.radiance(p.environment_point(directions), directions) for p in alone)
    assert lights.radiance(points, directions) == pytest.approx(both, rel=1e-5)

    power = lights.power
    mixture = sum(
        power[i] / power.sum() * alone[i].pdf_point(alone[i].environment_point(directions))
        for i in range(2)
    )
    assert lights.pdf_point(points) == pytest.approx(mixture, rel=1e-5)

    points, pdf = lights.sample_point(uniform(SAMPLES))
    found = (pdf > 0) & ~points["delta"]
    grid = direction_grid(transform[2, :3])
    masses = grid.masses(lambda d: lights.pdf_point(lights.environment_point(d)))
    assert masses.sum() == pytest.approx(1 - power[2] / power.sum(), abs=2e-3)
    assert_distributed_as(grid.counts(points["direction"][found]), masses, SAMPLES)


def test_powers_at_infinity_are_those_of_the_disk_that_they_light(probe):
    lights = probe(
        scene.DomeLight((1.0, 1.0, 1.0)),
        scene.DistantLight((2.0, 2.0, 2.0), 60.0),
        scene.DistantLight((5.0, 5.0, 5.0), 0.0),
        radius=3.0,
    )
    solid_angle = 2 * np.pi * (1 - np.cos(np.radians(30)))
    expected = 9 * np.pi * np.array([4 * np.pi, 2 * solid_angle, 5])
    assert lights.power == pytest.approx(expected, rel=1e-3)


def test_the_power_of_a_textured_dome_is_the_integral_of_its_radiance(probe):
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0), texture=0), textures=[sky(64, 32)], radius=1.0)
    directions = sphere_directions(200_000)
    value = luminance(lights.radiance(lights.environment_point(directions), directions))
    integral = 4 * np.pi * value.mean()
    error = 4 * np.pi * value.std() / np.sqrt(len(value))
    # Texel averages stand for the bilinear interpolation.
    assert lights.power[0] / np.pi == pytest.approx(integral, abs=4 * error + 0.01 * integral)


def test_origins_cover_a_disk_outside_the_scene_that_faces_the_light(probe, uniform):
    lights = probe(scene.DomeLight((1.0, 1.0, 1.0)), radius=3.0)
    directions = sphere_directions(SAMPLES)
    origins, pdf = lights.sample_origin(directions, uniform(SAMPLES, 2))
    assert pdf == pytest.approx(1 / (9 * np.pi), rel=1e-3)
    height = (origins * directions).sum(1)
    assert (height >= 3 - 1e-5).all() and height == pytest.approx(3, rel=1e-3)
    across = np.linalg.norm(origins - height[:, None] * directions, axis=1) / 3
    # Uniform on the disk: r² is uniform.
    counts, _ = np.histogram(across**2, bins=20, range=(0, 1.0003))
    assert np.abs(counts - SAMPLES / 20).max() < 5 * np.sqrt(SAMPLES / 20)
