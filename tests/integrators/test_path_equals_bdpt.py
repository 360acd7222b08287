"""Path tracing and bidirectional path tracing make the same picture.

They share vertices, closures and lights, so what this sees is what only one of them has: strategies
of light subpaths, connections, splats, and weights over all of them. A weight that does not sum to
one over the strategies of a path, a density in the wrong measure, a strategy that is counted twice
or left out, a missing adjoint correction for shading normals, radiance scaled at refraction in the
wrong direction, an offset that leaks or hides light: each biases the bidirectional picture alone.

Welch's t-tests between independent seeds: per pixel and channel and per block of 4 × 4 pixels with
Šidák's correction, and of the mean; each at the significance 10⁻³. The resolution that is asked
for says that a difference of some 4 % of the mean (1 % in the slow version) cannot hide.
"""

from __future__ import annotations

import numpy as np
import pytest

from support import scenes
from support.rendering import build, picture, pictures, rgba
from support.statistics import agreement

SEES = {
    "diffuse_box": "missing G or cosine, weights of connections",
    "glossy": "densities of microfacets in the two directions, cylinder and sphere lights",
    "rough_glass": "η² of rough refraction, adjoint of transmission",
    "smooth_glass": "Dirac densities in weights: strategies that cannot connect counted as if",
    "caustics": "strategies that would join at a Dirac vertex, on the side of light subpaths",
    "thin_lens": "density of the lens, splats through it",
    "dome_and_distant": "densities from infinity: solid angle against area; the Dirac sun",
    "instances": "areas and normals under non-uniform and mirroring transforms, lamps among them",
    "shading_normals": "sides of interpolated normals",
    "tilted_normals": "the adjoint correction |cosθ_s/cosθ_g| in joins and in sampled directions",
    "opacity": "coverage in contribution and density of edges, lights and lamps",
    "orthographic_camera": "a lens at infinity",
    "emission": "two-sided and textured emission, emitters that scatter",
    "layers": "values and densities of mixtures, coats and bent normals in both directions",
    "shaped_lights": "emission that varies with direction in the first edge of light subpaths",
    "motion": "one time for both subpaths, areas of lamps that grow, splats through a moving lens",
    "moving_lights": "lights at other times in one of the two, environments in another's frame",
    "one_sided": "sides of vertices and edges, seen from the eye, on what light subpaths trace",
    "linked_lights": "links at the first hit of light, in joins and where rays meet lights",
    "clipped_and_mirrored_camera": "splats through a clipped, shifted, left-handed window",
}


def test_every_scene_is_covered() -> None:
    assert set(SEES) == set(scenes.SCENES)


# Where the path tracer finds most light by chance only.
SAMPLES = {"tilted_normals": 256, "caustics": 64}


def compare(name: str, seeds: int, samples: int, filter: str = "box", depth: int = 6):
    built = build(scenes.build(name))
    settings = {"samples": samples, "depth": depth, "filter": filter}
    path = pictures(built, "path", seeds, **settings)
    bdpt = pictures(built, "bdpt", range(1000, 1000 + seeds), **settings)
    return agreement(path, bdpt)


@pytest.mark.parametrize("name", SEES)
def test_path_equals_bdpt(name: str) -> None:
    compare(name, seeds=24, samples=SAMPLES.get(name, 24)).require(resolution=0.015)


@pytest.mark.slow
@pytest.mark.parametrize("name", SEES)
def test_path_equals_bdpt_with_many_samples(name: str) -> None:
    compare(name, 48, 16 * SAMPLES.get(name, 24)).require(resolution=0.004)


@pytest.mark.parametrize("name", ["emission", "caustics"])
def test_splats_see_the_same_pixel_filter(name: str) -> None:
    """With a Gaussian, splats are spread as camera samples are, at the picture's edge too."""
    compare(name, seeds=24, samples=64, filter="gaussian").require(resolution=0.01)


@pytest.mark.parametrize("name", ["diffuse_box", "smooth_glass", "dome_and_distant", "opacity"])
@pytest.mark.parametrize("edges", [2, 3, 4])
def test_each_path_length_agrees(name: str, edges: int) -> None:
    """Errors of two lengths could cancel in the sum."""
    built = build(scenes.build(name))
    settings = {"samples": 24, "min_edges": edges, "depth": edges}
    path = pictures(built, "path", 16, **settings)
    bdpt = pictures(built, "bdpt", range(1000, 1016), **settings)
    agreement(path, bdpt).require(resolution=0.05)


@pytest.mark.parametrize("name", SEES)
def test_alpha_agrees(name: str) -> None:
    """Coverage is a matter of camera rays only: the same up to noise at half-covered pixels."""
    built = build(scenes.build(name))
    path, bdpt = (rgba(built, i, samples=64, depth=2)[..., 3] for i in ("path", "bdpt"))
    assert np.abs(path - bdpt).max() < 0.2
    assert abs(path.mean() - bdpt.mean()) < 0.01


def test_light_seen_directly_is_the_same_sample() -> None:
    """Paths of one edge have one strategy, on the same rays: the same picture to the bit."""
    built = build(scenes.build("emission"))
    path, bdpt = (picture(built, i, samples=4, depth=1) for i in ("path", "bdpt"))
    assert path.any()
    assert np.array_equal(path, bdpt)
