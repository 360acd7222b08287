"""What leaves surface lights: from which side, in which directions, and how much in all."""

import numpy as np
import pytest

from usdmlt import scene

SAMPLES = 100_000

SHAPINGS = {
    "plain": None,
    "default": scene.Shaping(),
    "cone": scene.Shaping(cone_angle_degrees=40.0),
    "soft": scene.Shaping(cone_angle_degrees=60.0, cone_softness=0.7),
    "focus": scene.Shaping(focus=8.0, focus_tint=(0.0, 0.1, 0.3)),
    "wide": scene.Shaping(focus=0.5, cone_angle_degrees=150.0, cone_softness=0.2),
}


@pytest.fixture(params=SHAPINGS)
def shaping(request):
    return SHAPINGS[request.param]


def axis_of(surface):
    z = -surface.light.transform[2, :3]
    return z / np.linalg.norm(z)


def one_point(lights, u):
    points, _ = lights.sample_point(np.array([[0.5, *u]], np.float32))
    return points


def test_lights_emit_from_one_side(surface, probe, uniform):
    lights = probe(surface)
    points, _ = lights.sample_point(uniform(1000))
    n = points["normal"]
    tilted = (n + 0.3 * np.roll(n, 1, 1)).astype(np.float32)
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    assert (lights.radiance(points, tilted) == 1).all()
    assert (lights.radiance(points, -tilted) == 0).all()


def test_directions_are_distributed_as_their_density(
    family, shaping, placed, probe, uniform, direction_grid, assert_distributed_as
):
    surface = family(placed((0.4, 0.3, 0.1), (1.0, 1.2, 0.9)), shaping=shaping)
    lights = probe(surface)
    grid = direction_grid(axis_of(surface))
    for u in ((0.2, 0.4), (0.6, 0.1)):
        points = one_point(lights, u)
        directions, pdf = lights.sample_direction(points, uniform(SAMPLES, 2))
        found = pdf > 0
        masses = grid.masses(lambda d, p=points: lights.pdf_direction(p, d))
        assert_distributed_as(grid.counts(directions[found]), masses, SAMPLES)


def test_the_density_of_a_direction_is_recomputed(family, shaping, placed, probe, uniform):
    lights = probe(family(placed((0.4, 0.3, 0.1)), shaping=shaping))
    points, _ = lights.sample_point(uniform(2000))
    directions, pdf = lights.sample_direction(points, uniform(2000, 2))
    again = lights.pdf_direction(points, directions)
    assert again[pdf > 0] == pytest.approx(pdf[pdf > 0], rel=1e-6)


def test_directions_are_unit_and_on_the_emitting_side(family, shaping, placed, probe, uniform):
    lights = probe(family(placed((0.4, 0.3, 0.1)), shaping=shaping))
    points, _ = lights.sample_point(uniform(2000))
    directions, pdf = lights.sample_direction(points, uniform(2000, 2))
    found = pdf > 0
    assert np.linalg.norm(directions[found], axis=1) == pytest.approx(1, abs=1e-6)
    assert ((directions * points["normal"]).sum(1)[found] > 0).all()


def test_wherever_a_light_emits_directions_have_a_density(family, shaping, placed, probe, uniform):
    lights = probe(family(placed((0.4, 0.3, 0.1)), shaping=shaping))
    points, _ = lights.sample_point(uniform(20_000))
    directions = np.random.default_rng(3).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    emits = lights.radiance(points, directions).max(1) > 0
    assert emits.sum() > 1000
    assert (lights.pdf_direction(points, directions)[emits] > 0).all()


def test_the_power_is_the_flux(family, shaping, transform, probe, uniform, assert_mean):
    """Φ = E[L cosθ / (p_A p_ω)]: radiance, both densities and the power agree."""
    lights = probe(family(transform, radiance=(2.0, 0.5, 1.0), shaping=shaping))
    points, pdf_area = lights.sample_point(uniform(SAMPLES))
    directions, pdf_direction = lights.sample_direction(points, uniform(SAMPLES, 2))
    found = pdf_direction > 0
    cosine = (directions * points["normal"]).sum(1).astype(float)
    luminance = lights.radiance(points, directions) @ [0.2126, 0.7152, 0.0722]
    flux = np.zeros(SAMPLES)
    flux[found] = (luminance * cosine)[found] / (pdf_area * pdf_direction)[found]
    # The power is a numerical integral, good to 0.1 %.
    assert flux.mean() == pytest.approx(
        lights.power[0], abs=4 * flux.std() / np.sqrt(SAMPLES) + 1e-3 * lights.power[0]
    )


def test_directions_of_a_spot_follow_its_radiance(families, placed, probe, uniform):
    """A flat light wastes no samples outside its cone, and its weights vary little inside."""
    shaping = scene.Shaping(focus=4.0, cone_angle_degrees=25.0, cone_softness=0.5)
    lights = probe(families["disk"](placed((0.2, 0.5, 0.1)), shaping=shaping))
    points, _ = lights.sample_point(uniform(50_000))
    directions, pdf = lights.sample_direction(points, uniform(50_000, 2))
    cosine = (directions * points["normal"]).sum(1)
    weight = lights.radiance(points, directions)[:, 0] * cosine / np.where(pdf > 0, pdf, 1)
    assert (pdf > 0).mean() > 0.999
    assert weight.std() < 0.05 * weight.mean()


def test_the_texture_of_a_rect_is_upright_to_a_viewer_in_front(probe):
    """The image's left edge is at local +x, its top at +y; seen from −z, that is left and up."""
    pixels = np.zeros((2, 2, 3), np.float32)
    pixels[0, 0], pixels[0, 1], pixels[1, 0] = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    light = scene.RectLight((2.0, 2.0, 2.0), 4.0, 2.0, texture=0)
    lights = probe(light, textures=[scene.Texture(pixels)])
    for inset in (0.1, 0.0):  # at the very edge too, although the texture repeats
        near, far = inset, 1 - inset
        uv = np.array([[far, far], [near, far], [far, near], [near, near]], np.float32)
        points = lights.shape_point(0, uv)
        assert points["position"][0] == pytest.approx([4 * (far - 0.5), 2 * (far - 0.5), 0])
        emitted = lights.radiance(points, np.array([[0, 0, -1]] * 4, np.float32))
        expected = np.array([[2, 0, 0], [0, 2, 0], [0, 0, 2], [0, 0, 0]])
        assert emitted == pytest.approx(expected, abs=1e-5)


def test_the_power_of_a_textured_rect_is_that_of_its_average(probe):
    pixels = np.random.default_rng(4).random((6, 8, 3)).astype(np.float32)
    light = scene.RectLight((2.0, 1.0, 0.5), 4.0, 2.0, texture=0)
    lights = probe(light, textures=[scene.Texture(pixels)])
    average = pixels.mean((0, 1)) * (2.0, 1.0, 0.5) @ [0.2126, 0.7152, 0.0722]
    assert lights.power[0] == pytest.approx(np.pi * 8 * average, rel=1e-5)
