"""Points of surface lights: samples follow their densities, from anywhere."""

import numpy as np
import pytest

SAMPLES = 100_000


def test_points_are_distributed_as_their_density(surface, probe, uniform, assert_distributed_as):
    lights = probe(surface)
    points, pdf = lights.sample_point(uniform(SAMPLES))
    assert (pdf > 0).all()
    masses = surface.masses(lambda uv: lights.pdf_point(lights.shape_point(0, uv)))
    assert masses.sum() == pytest.approx(1, abs=1e-4)
    assert_distributed_as(surface.counts(points["uv"]), masses, SAMPLES)


def test_sampled_points_lie_on_the_surface_and_face_its_emitting_side(surface, probe, uniform):
    points, _ = probe(surface).sample_point(uniform(1000))
    a, b = surface.ab(points["uv"].astype(np.float64))
    assert points["position"] == pytest.approx(surface.world(a, b), abs=3e-6)
    assert points["normal"] == pytest.approx(surface.normal(a, b), abs=1e-5)


# In front of flat lights (local −z), where every family is seen from.
REFERENCES = {
    "far": (1.0, -2.0, -30.0),
    "near": (0.5, 0.6, -0.9),
    "grazing": (2.5, 1.0, -0.3),
    "touching": (0.3, 0.2, -0.62),
}


def in_world(surface, reference):
    m = surface.light.transform
    return (np.array([reference]) @ m[:3, :3] + m[3, :3]).astype(np.float32)


@pytest.mark.parametrize("reference", REFERENCES.values(), ids=REFERENCES)
def test_points_sampled_for_a_reference_are_distributed_as_their_density(
    surface, reference, probe, uniform, assert_distributed_as
):
    lights = probe(surface)
    reference = in_world(surface, reference)
    points, pdf = lights.sample_direct(reference, uniform(SAMPLES))
    found = pdf > 0
    assert found.mean() > 0.9999
    masses = surface.masses(lambda uv: lights.pdf_direct(lights.shape_point(0, uv), reference))
    assert masses.sum() == pytest.approx(1, abs=2e-3)
    assert_distributed_as(surface.counts(points["uv"][found]), masses, SAMPLES)


def test_the_density_of_a_sample_is_recomputed_from_the_point(surface, probe, uniform):
    lights = probe(surface)
    points, pdf = lights.sample_point(uniform(1000))
    assert lights.pdf_point(points) == pytest.approx(pdf, rel=1e-9)
    for reference in REFERENCES.values():
        reference = in_world(surface, reference)
        points, pdf = lights.sample_direct(reference, uniform(1000))
        again = lights.pdf_direct(points, reference)
        assert again[pdf > 0] == pytest.approx(pdf[pdf > 0], rel=1e-9)


@pytest.mark.parametrize("name", ["rect", "disk"])
def test_flat_lights_are_not_sampled_from_behind(name, families, transform, probe, uniform):
    surface = families[name](transform)
    lights = probe(surface)
    reference = in_world(surface, (0.3, 0.2, 0.5))
    points, pdf = lights.sample_direct(reference, uniform(1000))
    assert (pdf == 0).all()
    points, _ = lights.sample_point(uniform(1000))
    assert (lights.pdf_direct(points, reference) == 0).all()


@pytest.mark.parametrize("name", ["sphere", "cylinder"])
def test_round_lights_are_not_sampled_from_inside(name, families, transform, probe, uniform):
    surface = families[name](transform)
    lights = probe(surface)
    _, pdf = lights.sample_direct(in_world(surface, (0.1, 0.2, -0.1)), uniform(1000))
    assert (pdf == 0).all()


@pytest.mark.parametrize("name", ["sphere", "cylinder"])
def test_round_lights_are_sampled_on_the_side_that_faces_the_reference(
    name, families, transform, probe, uniform
):
    surface = families[name](transform)
    reference = in_world(surface, REFERENCES["near"])
    points, pdf = probe(surface).sample_direct(reference, uniform(10_000))
    towards = ((reference - points["position"]) * points["normal"]).sum(1)
    assert (towards[pdf > 0] > -1e-6).all()


def test_true_spheres_are_sampled_uniformly_in_solid_angle(families, placed, probe, uniform):
    surface = families["sphere"](placed((0.4, 1.0, 0.2), (2.0, 2.0, 2.0)), radius=0.5)
    for distance in (1.001, 1.5, 1000.0):
        reference = np.array([[distance, 0.0, 0.0]], np.float32)
        points, pdf = probe(surface).sample_direct(reference, uniform(1000))
        to_light = points["position"].astype(float) - reference
        d2 = (to_light**2).sum(1)
        cosine = -(to_light * points["normal"]).sum(1) / np.sqrt(d2)
        solid_angle = 2 * np.pi * (1 - np.sqrt(1 - 1 / float(reference[0, 0]) ** 2))
        well_inside = cosine > 0.05
        density = (pdf * d2 / cosine)[well_inside]
        assert density == pytest.approx(1 / solid_angle, rel=2e-3 if distance < 1.01 else 1e-3)


def test_rectangles_are_sampled_uniformly_in_solid_angle_where_they_are_near(
    families, placed, probe, uniform
):
    surface = families["rect"](placed((0.4, 1.0, 0.2)), width=1.0, height=1.0)
    reference = in_world(surface, (0.2, -0.3, -0.5))
    points, pdf = probe(surface).sample_direct(reference, uniform(1000))
    to_light = points["position"].astype(float) - reference
    d2 = (to_light**2).sum(1)
    cosine = -(to_light * points["normal"]).sum(1) / np.sqrt(d2)

    def corner_term(x, y, z=0.5):
        return np.arctan2(x * y, z * np.sqrt(x * x + y * y + z * z))

    solid_angle = sum(corner_term(x, y) for x in (0.3, 0.7) for y in (0.2, 0.8))
    assert pdf * d2 / cosine == pytest.approx(1 / solid_angle, rel=1e-4)
