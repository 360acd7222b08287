"""Emissive triangles of meshes."""

import numpy as np
import pytest
from scipy import stats

from usdmlt import _core, closures, scene

SAMPLES = 100_000


def mesh_probe(meshes, materials, textures=(), **more):
    description = scene.Scene(materials=list(materials), textures=list(textures))
    compiled, slots = closures.compile_materials(description)
    assert slots in ({}, {"st": 0})
    return _core.LightsProbe(
        [], textures=list(textures), materials=compiled, meshes=list(meshes), **more
    )


def glow(r, g, b):
    return scene.Material(scene.UniformEmission((r, g, b)))


DARK = scene.Material(scene.Diffuse())

POINTS = np.random.default_rng(8).normal(size=(12, 3)).astype(np.float32)
TRIANGLES = np.arange(12, dtype=np.int32).reshape(4, 3)


@pytest.fixture(params=[[0, 0, 0, 0], [1, 0, 2, 0], [1, 2, 1, 1]], ids=str)
def mesh(request, placed):
    """Four triangles; materials 0 and 2 emit."""
    transform = placed((0.4, 0.1, 0.9), (1.0, -2.0, 0.7), 0.3, (1.0, 2.0, 3.0))
    return scene.Mesh(
        POINTS, TRIANGLES, materials=np.array(request.param, np.int32), transform=transform
    )


MATERIALS = (glow(1.0, 2.0, 3.0), DARK, glow(4.0, 4.0, 4.0))
IMPORTANCE = np.array([[1.0, 2.0, 3.0], [0, 0, 0], [4.0, 4.0, 4.0]]) @ [0.2126, 0.7152, 0.0722]


def corners(mesh):
    world = mesh.points @ mesh.transform[:3, :3] + mesh.transform[3, :3]
    return world[mesh.triangles]


def areas(mesh):
    a, b, c = corners(mesh).transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def test_triangles_are_chosen_by_area_and_emission(mesh, uniform):
    lights = mesh_probe([mesh], MATERIALS)
    points, pdf = lights.sample_point(uniform(SAMPLES))
    weights = areas(mesh) * IMPORTANCE[mesh.materials]
    probability = weights / weights.sum()
    counts = np.bincount(points["primitive"], minlength=4)
    emits = probability > 0
    assert (counts[~emits] == 0).all()
    if emits.sum() > 1:
        expected = probability[emits] * SAMPLES
        assert stats.chisquare(counts[emits], expected).pvalue > 1e-4
    expected = (probability / areas(mesh))[points["primitive"]]
    assert pdf == pytest.approx(expected, rel=1e-5)
    assert lights.pdf_point(points) == pytest.approx(pdf, rel=1e-9)
    assert lights.power[0] == pytest.approx(2 * np.pi * weights.sum(), rel=1e-5)


def test_points_are_uniform_on_their_triangle(mesh, uniform, assert_mean):
    points, _ = mesh_probe([mesh], MATERIALS).sample_point(uniform(SAMPLES))
    b1, b2 = points["uv"].astype(float).T
    b0 = 1 - b1 - b2
    assert min(b0.min(), b1.min(), b2.min()) >= -1e-6
    # Moments of the uniform distribution on a triangle.
    assert_mean(np.stack([b0, b1, b2], 1), np.full(3, 1 / 3))
    assert_mean(np.stack([b0 * b0, b1 * b1, b2 * b2], 1), np.full(3, 1 / 6))
    assert_mean(np.stack([b0 * b1, b1 * b2, b2 * b0], 1), np.full(3, 1 / 12))
    at = (np.stack([b0, b1, b2], 1)[..., None] * corners(mesh)[points["primitive"]]).sum(1)
    assert points["position"] == pytest.approx(at, abs=1e-5)


def test_a_ray_finds_the_point_that_was_sampled(mesh, uniform):
    lights = mesh_probe([mesh], MATERIALS)
    points, _ = lights.sample_point(uniform(100))
    assert np.array_equal(lights.mesh_point(0, points["primitive"], points["uv"]), points)


def test_triangles_that_do_not_emit_have_no_density(mesh):
    lights = mesh_probe([mesh], MATERIALS)
    points = lights.mesh_point(0, np.arange(4), np.full((4, 2), 0.3, np.float32))
    emits = IMPORTANCE[mesh.materials] > 0
    reference = np.ones((1, 3), np.float32)
    assert np.array_equal(lights.pdf_point(points) > 0, emits)
    assert np.array_equal(lights.pdf_direct(points, reference) > 0, emits)


def test_triangles_emit_from_both_sides(mesh, uniform):
    lights = mesh_probe([mesh], MATERIALS)
    points, _ = lights.sample_point(uniform(100))
    colors = np.array([[1, 2, 3], [0, 0, 0], [4, 4, 4]])[mesh.materials[points["primitive"]]]
    for side in (points["normal"], -points["normal"]):
        assert lights.radiance(points, side) == pytest.approx(colors)


def test_directions_leave_both_sides_by_the_cosine(
    mesh, uniform, direction_grid, assert_distributed_as
):
    lights = mesh_probe([mesh], MATERIALS)
    points = lights.sample_point(uniform(1))[0]
    directions, pdf = lights.sample_direction(points, uniform(SAMPLES, 2))
    cosine = np.abs(directions.astype(float) @ points["normal"][0])
    assert pdf == pytest.approx(cosine / (2 * np.pi), rel=2e-5)
    grid = direction_grid(points["normal"][0])
    masses = grid.masses(lambda d: lights.pdf_direction(points, d))
    assert_distributed_as(grid.counts(directions), masses, SAMPLES)


def test_the_normal_keeps_its_side_under_mirroring(mesh):
    lights = mesh_probe([mesh], MATERIALS)
    points = lights.mesh_point(0, np.arange(4), np.full((4, 2), 0.3, np.float32))
    a, b, c = mesh.points.astype(float)[mesh.triangles].transpose(1, 0, 2)
    n = np.cross(b - a, c - a) @ np.linalg.inv(mesh.transform[:3, :3]).T
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert points["normal"] == pytest.approx(n, abs=1e-5)


def test_irradiance_of_a_glowing_square(placed, uniform, assert_mean):
    """The form factor of a square over its centre, by both ways of choosing points."""
    points = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    square = scene.Mesh(
        points, np.array([[0, 1, 2], [0, 2, 3]]), transform=placed(position=(0, 0, 1.0))
    )
    lights = mesh_probe([square], [glow(1.0, 2.0, 0.0)])
    factor = 4 / np.pi / np.sqrt(2) * np.arctan(1 / np.sqrt(2))
    for sample in (
        lights.sample_point,
        lambda u: lights.sample_direct(np.zeros((1, 3), np.float32), u),
    ):
        points, pdf = sample(uniform(SAMPLES))
        position = points["position"].astype(float)
        d2 = (position**2).sum(1)
        cosine2 = position[:, 2] ** 2 / d2
        emitted = lights.radiance(points, -position.astype(np.float32))
        assert_mean(emitted * (cosine2 / d2 / pdf)[:, None], np.pi * factor * np.array([1, 2, 0]))


def test_the_power_is_the_flux_of_a_textured_mesh(uniform, assert_mean):
    """A screen of two triangles, most of it dark: sampled wherever it shines, power = flux."""
    pixels = np.zeros((32, 32, 3), np.float32)
    pixels[20:26, 3:9] = (5.0, 1.0, 0.0)
    screen = scene.Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]]),
        primvars={
            "st": scene.Primvar(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)),
        },
    )
    material = scene.Material(scene.UniformEmission(scene.TextureInput(0)))
    lights = mesh_probe([screen], [material], [scene.Texture(pixels)])
    points, pdf = lights.sample_point(uniform(SAMPLES))
    assert set(points["primitive"]) == {0, 1}
    luminance = lights.radiance(points, points["normal"]) @ [0.2126, 0.7152, 0.0722]
    flux = 2 * np.pi * luminance / pdf
    exact = 2 * np.pi * 36 / 1024 * (5 * 0.2126 + 0.7152)
    assert_mean(flux, exact)
    # The triangle without light is kept, at a twentieth of the average.
    assert lights.power[0] == pytest.approx(exact, rel=0.05)


def test_instances_of_a_mesh_are_lights_of_their_own(placed, uniform):
    meshes = [
        scene.Mesh(POINTS, TRIANGLES, transform=placed(scale=(s, s, s), position=(s, 0, 0)))
        for s in (1.0, 3.0)
    ]
    lights = mesh_probe(meshes, [glow(1.0, 1.0, 1.0)])
    assert lights.power[1] == pytest.approx(9 * lights.power[0], rel=1e-5)
    points, _ = lights.sample_point(uniform(SAMPLES))
    assert (points["light"] == 1).mean() == pytest.approx(0.9, abs=5 * np.sqrt(0.09 / SAMPLES))


def test_degenerate_triangles_are_left_out(uniform):
    flat = scene.Mesh(np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], np.float32), TRIANGLES[:1])
    lights = mesh_probe([flat], [glow(1.0, 1.0, 1.0)])
    assert lights.power[0] == 0
    assert (lights.sample_point(uniform(10))[1] == 0).all()
