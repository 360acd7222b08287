"""A medium of albedo 1 in a closed emitter of radiance 1 that reflects nothing.

Nothing is lost and nothing gained: the light of all path lengths together is 1 in every pixel, of
every channel, whatever the phase function. Light of one edge is e^{−σ d}, d from the camera to the
wall; of two edges,

    ∫_0^d σ e^{−σ t} ∫ p(ω) e^{−σ d(x, ω)} dω dt,

which is averaged here over points of the pixel's rays and directions by a rule of its own. Together
they see a wrong norm, densities that do not belong to their samples, weights that do not sum to one
at any length, and light lost or gained where channels differ.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import qmc

from support.rendering import ALL, build, pictures, work
from support.shapes import perspective, sphere
from support.statistics import agreement
from usdmlt import scene as s

GLOW = s.Material(s.UniformEmission((1.0, 1.0, 1.0)))
EYE, TARGET = np.array([0.3, -0.2, 0.4]), (1.0, 0.3, -0.2)
MEDIA = {
    "isotropic": s.Medium((0.6,) * 3),
    "forwards": s.Medium((0.8,) * 3, anisotropy=0.6),
    "chromatic": s.Medium((0.2, 0.6, 1.3), anisotropy=-0.3),
    "Rayleigh": s.Medium((0.5,) * 3, phase="rayleigh"),
}


def furnace(medium: s.Medium) -> s.Scene:
    shell = sphere(1.0, rings=12, inward=True)
    camera = perspective(EYE, TARGET, 90)
    return s.Scene(camera, 9, 6, meshes=[shell], materials=[GLOW], media=[medium], world_medium=0)


def distances(built, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    return built.intersect(origins, directions)["distance"].astype(np.float64)


def rays_of_pixels(scene: s.Scene, points: np.ndarray) -> np.ndarray:
    """Unit directions (h, w, n, 3) through points (n, 2) of every pixel."""
    left, right, bottom, top = scene.camera.window
    u = (np.arange(scene.width)[:, None] + points[:, 0]) / scene.width
    v = (np.arange(scene.height)[:, None] + points[:, 1]) / scene.height
    x, y = np.broadcast_arrays(
        (left + (right - left) * u)[None], (top + (bottom - top) * v)[:, None]
    )
    d = np.stack([x, y, -np.ones_like(x)], -1) @ scene.camera.transform[:3, :3]
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def one_edge(scene: s.Scene) -> np.ndarray:
    x, w = np.polynomial.legendre.leggauss(6)
    points = np.stack(np.meshgrid((x + 1) / 2, (x + 1) / 2), -1).reshape(-1, 2)
    weights = np.outer(w, w).ravel() / 4
    directions = rays_of_pixels(scene, points)
    flat = directions.reshape(-1, 3)
    d = distances(build(scene), np.broadcast_to(EYE, flat.shape), flat)
    through = np.exp(-d[:, None] * np.array(scene.media[0].scattering))
    return np.tensordot(through.reshape(*directions.shape[:3], 3), weights, axes=(2, 0))


def phase(medium: s.Medium, cosine: np.ndarray) -> np.ndarray:
    if medium.phase == "rayleigh":
        return 3 / (16 * np.pi) * (1 + cosine**2)
    g = medium.anisotropy
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)


def two_edges(scene: s.Scene, count: int = 12) -> np.ndarray:
    """By 2^count points of a Sobol sequence in all five dimensions, per pixel."""
    medium, built = scene.media[0], build(scene)
    sigma = np.array(medium.scattering)
    u = qmc.Sobol(5, seed=1).random_base2(count)
    directions = rays_of_pixels(scene, u[:, :2])
    z, phi = 1 - 2 * u[:, 2], 2 * np.pi * u[:, 3]
    r = np.sqrt(1 - z**2)
    on = np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)
    out = np.empty((scene.height, scene.width, 3))
    for row in range(scene.height):
        for column in range(scene.width):
            d = directions[row, column]
            reach = distances(built, np.broadcast_to(EYE, d.shape), d)
            t = reach * u[:, 4]
            ahead = distances(built, EYE + t[:, None] * d, on)
            weight = 4 * np.pi * phase(medium, (d * on).sum(1)) * reach
            out[row, column] = (
                weight[:, None] * sigma * np.exp(-sigma * (t + ahead)[:, None])
            ).mean(0)
    return out


QUICK = 96  # samples


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("name", ["forwards", "chromatic"])
def test_all_lengths_together_are_one(name: str, integrator: str) -> None:
    """Up to 24 edges: what scatters more often is less than 1e-3."""
    scene = furnace(MEDIA[name])
    got = pictures(scene, integrator, 16, depth=24, **work(integrator, QUICK))
    agreement(got, np.ones(got.shape[1:])).require(resolution=0.005)


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("name", ["chromatic"])
def test_one_edge_is_what_comes_through(name: str, integrator: str) -> None:
    scene = furnace(MEDIA[name])
    got = pictures(scene, integrator, 16, depth=1, **work(integrator, QUICK))
    agreement(got, one_edge(scene)).require(resolution=0.01)


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("name", ["forwards", "chromatic"])
def test_two_edges_are_the_integral(name: str, integrator: str) -> None:
    scene = furnace(MEDIA[name])
    settings = {"min_edges": 2, "depth": 2, **work(integrator, QUICK)}
    got = pictures(scene, integrator, 16, **settings)
    agreement(got, two_edges(scene)).require(resolution=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("name", MEDIA)
def test_lengths_by_many_samples(name: str, integrator: str) -> None:
    scene = furnace(MEDIA[name])
    settings = work(integrator, 16 * QUICK)
    for low, high, expected in (
        (1, 24, np.ones((scene.height, scene.width, 3))),
        (1, 1, one_edge(scene)),
        (2, 2, two_edges(scene, 15)),
    ):
        got = pictures(scene, integrator, 24, min_edges=low, depth=high, **settings)
        answer = agreement(got, expected)
        print(f"{name:10} {integrator:5} {low:2} to {high:2} {answer}")
        answer.require(resolution=0.003)
