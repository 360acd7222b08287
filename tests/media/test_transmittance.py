"""Light through media that only absorb, whose pictures are known exactly.

Nothing is left to chance along these paths but where in a pixel they start, and a parallel camera
makes that all the same: path and bidirectional tracing have no noise at all where light is met by
the camera's rays. Seen: transmittance counted twice or left out in one way to make a path, lengths
of the wrong stretch, bodies left on the wrong side.
"""

from __future__ import annotations

import numpy as np
import pytest

from support.media_scenes import volume
from support.rendering import ALL, BOTH, picture, pictures, work
from support.shapes import box, facing, floor, orthographic, quad, rotate
from support.statistics import agreement
from usdmlt import scene as s

SIGMA = np.array([0.2, 1.0, 3.0])
GLOW = s.Material(s.UniformEmission((1.0, 2.0, 3.0)))
RADIANCE = np.array([1.0, 2.0, 3.0])
AHEAD = orthographic((0, 0, 3), (0, 0, 0), 1.0)


def expect(scene: s.Scene, integrator: str, color: np.ndarray, exact: bool, **settings: object):
    """The picture is of one colour."""
    expected = np.broadcast_to(color, (scene.height, scene.width, 3))
    if exact:
        got = picture(scene, integrator, samples=4, **settings)
        np.testing.assert_allclose(got, expected, rtol=2e-5)
    else:
        got = pictures(scene, integrator, 16, **work(integrator, 64), **settings)
        agreement(got, expected).require(resolution=0.01)


def slab(turn: float, sigma: object = SIGMA, **content: object) -> s.Scene:
    """0.7 thick, wide, turned by an angle."""
    shape = box((-9, -9, -0.35), (9, 9, 0.35), transform=rotate((0.3, 1, 0), turn))
    return s.Scene(
        AHEAD, 6, 4, media=[s.Medium(absorption=tuple(sigma))], volumes=[volume(shape, 0)],
        **content,
    )  # fmt: skip


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("turn", [0, 40, 65])
def test_beer_s_law_of_a_slab_before_a_lamp(integrator: str, turn: float) -> None:
    scene = slab(turn, meshes=[quad((-2, -2, -10), (4, 0, 0), (0, 4, 0))], materials=[GLOW])
    length = 0.7 / np.cos(np.radians(turn))
    expect(scene, integrator, RADIANCE * np.exp(-SIGMA * length), integrator != "mlt", depth=1)


@pytest.mark.parametrize("integrator", ALL)
def test_beer_s_law_of_a_slab_before_the_sky(integrator: str) -> None:
    scene = slab(40, lights=[s.DomeLight((1.0, 2.0, 3.0))])
    color = RADIANCE * np.exp(-SIGMA * 0.7 / np.cos(np.radians(40)))
    expect(scene, integrator, color, integrator != "mlt", depth=1)


@pytest.mark.parametrize("integrator", ALL)
def test_a_camera_within_a_medium_that_fills_the_world(integrator: str) -> None:
    scene = s.Scene(
        AHEAD, 6, 4, meshes=[quad((-2, -2, -1), (4, 0, 0), (0, 4, 0))], materials=[GLOW],
        media=[s.Medium(absorption=tuple(SIGMA))], world_medium=0,
    )  # fmt: skip
    expect(scene, integrator, RADIANCE * np.exp(-SIGMA * 4), integrator != "mlt", depth=1)


@pytest.mark.parametrize("integrator", ALL)
def test_a_slab_of_varying_density(integrator: str) -> None:
    """Along z from 0.5 to 1.5, of constant slope between the outermost centres: mean density 1."""
    values = np.linspace(0.5, 1.5, 5, dtype=np.float32)[None, None, :]
    lower, upper = (-9, -9, -1), (9, 9, 1)
    scene = s.Scene(
        AHEAD, 6, 4, meshes=[quad((-2, -2, -10), (4, 0, 0), (0, 4, 0))], materials=[GLOW],
        media=[s.Medium(absorption=tuple(SIGMA), grid=s.Grid(values, lower, upper))],
        volumes=[volume(box(lower, upper), 0)],
    )  # fmt: skip
    expect(scene, integrator, RADIANCE * np.exp(-SIGMA * 2), integrator != "mlt", depth=1)


def fresnel(cosine: float, eta: float) -> tuple[float, float]:
    """Reflectance of unpolarised light, and the cosine behind."""
    inner = np.sqrt(1 - (1 - cosine**2) / eta**2)
    parallel = (eta * cosine - inner) / (eta * cosine + inner)
    perpendicular = (cosine - eta * inner) / (cosine + eta * inner)
    return (parallel**2 + perpendicular**2) / 2, inner


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("turn", [0, 50])
def test_a_plate_of_coloured_glass(integrator: str, turn: float) -> None:
    """In a white world: what is reflected, and R + (1−R)² T / (1 − R T) in all."""
    plate = box((-40, -40, -0.35), (40, 40, 0.35), transform=rotate((0.3, 1, 0), turn), medium=0)
    scene = s.Scene(
        AHEAD, 6, 4, meshes=[plate], lights=[s.DomeLight((1, 1, 1))],
        materials=[s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))],
        media=[s.Medium(absorption=tuple(SIGMA))],
    )  # fmt: skip
    R, inner = fresnel(np.cos(np.radians(turn)), 1.5)
    T = np.exp(-SIGMA * 0.7 / inner)
    expect(scene, integrator, R + (1 - R) ** 2 * T / (1 - R * T), False, depth=12)


@pytest.mark.parametrize("integrator", ALL)
def test_sunlight_through_a_slab_onto_a_floor(integrator: str) -> None:
    """Albedo / π · irradiance · cosθ · e^{−σ d / cosθ}: connections pass the slab, camera rays
    do not. The light subpaths of bidirectional tracing come through it as well."""
    theta = np.radians(35)
    scene = s.Scene(
        orthographic((0, 1, 0), (0, 0, 0), 1.0, up=(0, 0, -1)), 6, 4,
        meshes=[floor(0, half=2)],
        materials=[s.Material(s.Diffuse((0.5, 0.5, 0.5)))],
        lights=[s.DistantLight((3, 2, 1), 0.0,
                               facing((0, 0, 0), (np.sin(theta), -np.cos(theta), 0)))],
        media=[s.Medium(absorption=tuple(SIGMA))],
        volumes=[volume(box((-6, 2, -6), (6, 2.4, 6)), 0)],
    )  # fmt: skip
    color = 0.5 / np.pi * np.array([3, 2, 1]) * np.cos(theta)
    color = color * np.exp(-SIGMA * 0.4 / np.cos(theta))
    expect(scene, integrator, color, integrator == "path", depth=2)


@pytest.mark.parametrize("integrator", BOTH)
def test_a_slab_that_glows_and_absorbs(integrator: str) -> None:
    """ε / σ · (1 − e^{−σ d}), before a lamp that it dims."""
    emission = np.array([0.5, 1.0, 2.0])
    scene = slab(40, meshes=[quad((-2, -2, -10), (4, 0, 0), (0, 4, 0))], materials=[GLOW])
    scene.media[0].emission = tuple(emission)
    T = np.exp(-SIGMA * 0.7 / np.cos(np.radians(40)))
    color = emission / SIGMA * (1 - T) + RADIANCE * T
    expect(scene, integrator, color, False, depth=1)
