"""Light scattered once by an infinite medium, from a lamp as good as a point.

    L = ∫ σ_s e^{−σ_t (t + r)} p(cosθ) I / r² dt

along the pixel's rays, r from there to the lamp; I = π ρ² L_e the intensity of a ball of radius ρ.
The integral is done by Gauss's rule here. Seen: a phase function turned round, densities of stops
that are not those of the samples, a chromatic mixture with a bias, a geometry term or a cosine too
much, transmittance of one of the two edges only.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from support.rendering import ALL, BOTH, pictures, work
from support.shapes import perspective, translate
from support.statistics import Agreement, agreement
from usdmlt import scene as s

LAMP, RADIUS, EMITTED = np.array([2.6, 0.9, 0.3]), 0.004, np.array([4e4, 5e4, 6e4])
EYE, TARGET, FOV = np.array([0.2, -0.1, 3.0]), (0.0, 0.0, 0.0), 40
MEDIA = {
    "isotropic": s.Medium((0.3,) * 3, (0.1,) * 3),
    "forwards": s.Medium((0.3,) * 3, anisotropy=0.7),
    "backwards": s.Medium((0.5,) * 3, (0.1,) * 3, anisotropy=-0.5),
    "Rayleigh": s.Medium((0.2, 0.4, 0.9), phase="rayleigh"),
    "chromatic": s.Medium((0.05, 0.4, 1.5), (0.5, 0.0, 0.2), anisotropy=0.3),
    "one channel is clear": s.Medium((0.0, 0.3, 1.0), (0.0, 0.1, 0.0)),
}


def scene_of(medium: s.Medium) -> s.Scene:
    lamp = s.SphereLight(tuple(EMITTED), RADIUS, translate(*LAMP))
    camera = perspective(EYE, TARGET, FOV)
    return s.Scene(camera, 12, 8, lights=[lamp], media=[medium], world_medium=0)


def phase(medium: s.Medium, cosine: np.ndarray) -> np.ndarray:
    if medium.phase == "rayleigh":
        return 3 / (16 * np.pi) * (1 + cosine**2)
    g = medium.anisotropy
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)


def pixel_rays(scene: s.Scene, per_pixel: int) -> np.ndarray:
    """Unit directions (h, w, n², 3) through Gauss's points of pixels, and their weights (n²,)."""
    x, w = np.polynomial.legendre.leggauss(per_pixel)
    left, right, bottom, top = scene.camera.window
    u = (np.arange(scene.width)[:, None] + (x + 1) / 2) / scene.width
    v = (np.arange(scene.height)[:, None] + (x + 1) / 2) / scene.height
    across, down = left + (right - left) * u, top + (bottom - top) * v
    a, b = np.broadcast_arrays(across[None, :, None, :], down[:, None, :, None])
    local = np.stack([a, b, -np.ones_like(a)], -1)
    d = local @ scene.camera.transform[:3, :3]
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    weights = (w[:, None] * w[None, :]).ravel() / 4
    return d.reshape(scene.height, scene.width, -1, 3), weights


def by_quadrature(medium: s.Medium) -> np.ndarray:
    sigma_s, sigma_a = np.array(medium.scattering), np.array(medium.absorption)
    sigma_t = sigma_s + sigma_a
    directions, weights = pixel_rays(scene_of(medium), 4)
    # t = t0 + D tan α, α equiangular as seen from the lamp.
    t0 = directions @ (LAMP - EYE)
    D = np.sqrt(((LAMP - EYE) ** 2).sum() - t0**2)
    x, w = np.polynomial.legendre.leggauss(96)
    low = np.arctan2(-t0, D)[..., None]
    alpha = low + (np.pi / 2 - low) * (x + 1) / 2
    t, r = t0[..., None] + D[..., None] * np.tan(alpha), D[..., None] / np.cos(alpha)
    # dt = r² / D dα, and 1/r² in the integrand. From the lamp's surface, not from its centre.
    dt = w / 2 * (np.pi / 2 - low) / D[..., None]
    points = EYE + t[..., None] * directions[..., None, :]
    arriving = (points - LAMP) / r[..., None]
    cosine = -(arriving * directions[..., None, :]).sum(-1)
    common = phase(medium, cosine) * dt
    through = np.exp(-sigma_t * (t + r - 2 / 3 * RADIUS)[..., None])
    radiance = (common[..., None] * through).sum(-2) * sigma_s * np.pi * RADIUS**2 * EMITTED
    return np.tensordot(radiance, weights, axes=(2, 0))


def compare(name: str, integrator: str, seeds: int, samples: int) -> Agreement:
    medium = MEDIA[name]
    settings = {"min_edges": 2, "depth": 2, **work(integrator, samples)}
    got, expected = pictures(scene_of(medium), integrator, seeds, **settings), by_quadrature(medium)
    there = expected.max(axis=(0, 1)) > 0
    assert not got[..., ~there].any()
    return agreement(got[..., there], expected[..., there])


@pytest.mark.parametrize(
    ("name", "integrator"), [*product(MEDIA, BOTH), ("forwards", "mlt"), ("chromatic", "mlt")]
)
def test_light_scattered_once(name: str, integrator: str) -> None:
    samples = 32 if integrator == "mlt" else 96
    compare(name, integrator, 16, samples).require(resolution=0.01, block_resolution=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("name", MEDIA)
def test_light_scattered_once_by_many_samples(name: str, integrator: str) -> None:
    got = compare(name, integrator, 24, 768 if integrator == "mlt" else 2048)
    print(f"{name:22} {integrator:5} {got}")
    got.require(resolution=0.002, block_resolution=0.006)
