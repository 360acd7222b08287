"""The same pictures as Mitsuba 3: content built from the same arrays, paths of the same lengths.

Someone else's code shares none of our mistakes. Welch's t-tests between independent seeds per
pixel, per block of 4 × 4 pixels ("no structure in the difference") and of the mean, each at the
significance 10⁻³. The quick tests see a mean that is off by four standard errors of 0.35 %; the
slow ones by four of 0.25 %, with the means within 0.5 %. All of our integrators are compared:
chains in the quick tests where their light is Dirac's, infinite or through a lens.

Geometry is flat-shaded: renderers differ on light at grazing angles to interpolated normals. GGX
is compared where its masking matters little: Mitsuba takes Smith's for the two directions as
independent, we take it as correlated by height (Heitz 2014), which is brighter at grazing angles.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from support import scenes
from support.beside_mitsuba import compare
from support.rendering import ALL, BOTH
from support.scenes import GREY, RED, WHITE, picture_of
from support.shapes import box, facing, floor, perspective, quad, rotate, sphere, translate
from usdmlt import scene as s


def diffuse() -> s.Scene:
    """A Cornell box."""
    return scenes.build("diffuse_box")


def sphere_light() -> s.Scene:
    return picture_of(
        perspective((0, 2.5, 5), (0, 0.5, 0), 38),
        meshes=[floor(0), box((-0.9, 0, -0.4), (-0.1, 1.1, 0.4), 1), sphere(
            0.5, 2, rings=6, transform=translate(0.8, 0.5, 0.2))],
        materials=[WHITE, RED, GREY],
        lights=[s.SphereLight((9, 8, 7), 0.5, translate(1.0, 2.4, 1.0))],
    )  # fmt: skip


def glass() -> s.Scene:
    """A smooth glass ball and a block of glass before a large light: reflections, refractions,
    total reflection and caustics."""
    material = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))
    return picture_of(
        perspective((0, 2, 5), (0, 0.6, 0), 36),
        meshes=[
            floor(0),
            sphere(0.8, 1, rings=24, transform=translate(-0.8, 0.9, 0)),
            box((-0.5, -0.4, -0.2), (0.5, 0.4, 0.2), 1,
                transform=rotate((0.2, 1, 0), 30) @ translate(1.0, 0.7, 0.4)),
        ],
        materials=[WHITE, material],
        lights=[s.RectLight((3, 3, 3), 3.0, 3.0, facing((0.5, 3.2, 0), (0.4, 0, 0), (0, 0, 1)))],
    )  # fmt: skip


def rough_conductor() -> s.Scene:
    """Plates of gold that mirror a coloured room."""
    gold = s.Material(s.Conductor((0.143, 0.375, 1.442), (3.983, 2.386, 1.603), 0.1))
    green = s.Material(s.Diffuse((0.2, 0.6, 0.3)))
    return picture_of(
        perspective((0, 2.2, 4), (0, 0.5, 0), 40),
        meshes=[
            floor(0),
            quad((-1.6, 0.1, 0.8), (1.5, 0, 0), (0, 0.5, -1.2), 1),
            quad((0.2, 0.2, 0.5), (1.2, 0, -0.4), (0, 1.0, -0.4), 1),
            box((-0.7, 0, -1.8), (0.1, 1.2, -1.2), 2),
            quad((1.9, 0, -1.5), (0, 0, 2), (0, 1.5, 0), 3),
        ],
        materials=[WHITE, gold, RED, green],
        lights=[s.RectLight((7, 7, 7), 1.5, 1.5, facing((-1, 3.4, 1.5), (0, 0.3, 0)))],
    )


def rough_glass() -> s.Scene:
    material = s.Material(s.Dielectric(1.5, 0.1, scatter_mode="RT"))
    return picture_of(
        perspective((0, 2.4, 5), (0, 0.5, 0), 36),
        meshes=[
            floor(0),
            box((-0.9, -0.15, -0.9), (0.9, 0.15, 0.9), 1,
                transform=rotate((1, 0, 0.3), 20) @ translate(0, 0.8, 0)),
        ],
        materials=[WHITE, material],
        lights=[s.RectLight((2, 2, 2), 4.0, 4.0, facing((0.5, 3.4, -0.5), (0, 0, 0), (0, 0, 1)))],
    )  # fmt: skip


def textured() -> s.Scene:
    """Bilinear lookups of linear values, repeated three times and more."""
    rng = np.random.default_rng(12)
    pixels = rng.uniform(0.05, 0.95, (5, 7, 3)).astype(np.float32)
    ground, wall = floor(0), quad((-1.5, 0, -1), (3, 0, 0.4), (0, 2, 0), 1)
    ground.primvars["st"].values *= (3.0, 2.5)
    wall.primvars["st"].values += (0.3, -0.7)
    return picture_of(
        perspective((0, 2.2, 4), (0, 0.6, 0), 45),
        meshes=[ground, wall, box((-0.3, 0, 0), (0.4, 0.6, 0.6), 2)],
        materials=[
            s.Material(s.Diffuse(s.TextureInput(0))),
            s.Material(s.Diffuse(s.TextureInput(1))),
            GREY,
        ],
        textures=[s.Texture(pixels), s.Texture(pixels[::-1].copy(), "mirror", "mirror")],
        lights=[s.RectLight((8, 8, 8), 1.5, 1.5, facing((1.5, 3, 2), (0, 0.3, 0)))],
    )


def smooth_sky(width: int = 128, height: int = 64) -> np.ndarray:
    """A function of the direction without edges, so that the place of texels hardly matters."""
    theta = (np.arange(height) + 0.5) / height * np.pi
    phi = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    d = np.stack(np.broadcast_arrays(
        np.sin(theta)[:, None] * np.sin(phi), np.cos(theta)[:, None],
        np.sin(theta)[:, None] * np.cos(phi)), -1)  # fmt: skip
    sun = np.array([0.5, 0.7, 0.5]) / np.linalg.norm([0.5, 0.7, 0.5])
    glow = 6 * np.exp(4 * (d @ sun - 1))
    color = np.stack([0.4 + 0.2 * d[..., 0], 0.5 + 0.1 * d[..., 2], 0.6 + 0.3 * d[..., 1]], -1)
    return (color + glow[..., None] * (1.0, 0.8, 0.5)).astype(np.float32)


def dome() -> s.Scene:
    """A textured dome about a turned axis, seen directly and by what it lights; a Dirac sun."""
    return picture_of(
        perspective((0, 1.5, 5), (0, 0.8, 0), 42),
        meshes=[floor(0, 2.0), box((-1.2, 0, -0.6), (-0.2, 1.1, 0.4), 1), sphere(
            0.7, 2, rings=8, transform=translate(0.9, 0.8, 0.2))],
        materials=[WHITE, RED, GREY],
        textures=[s.Texture(smooth_sky())],
        lights=[
            s.DomeLight((0.6, 0.7, 0.9), 0, rotate((1, 0.2, 0.4), 70)),
            s.DistantLight((0.8, 0.7, 0.6), 0.0, facing((0, 0, 0), (1, -1, -1))),
        ],
    )  # fmt: skip


def thin_lens() -> s.Scene:
    scene = scenes.build("thin_lens")
    scene.materials[3] = GREY  # Mitsuba's meshes emit to one side only
    return scene


def interpolated_normals() -> s.Scene:
    ball = sphere(0.9, 1, rings=24, smooth=True)
    ball.points += np.float32([0, 0.9, 0])
    return picture_of(
        perspective((0, 2, 4.5), (0, 0.6, 0), 36),
        meshes=[floor(0), ball],
        materials=[WHITE, GREY],
        lights=[s.SphereLight((9, 8, 7), 0.5, translate(1.0, 2.8, 2.0))],
    )


def normal_map() -> s.Scene:
    """Tangents along the texture's s."""
    rng = np.random.default_rng(13)
    n = rng.normal(size=(6, 6, 3)) * (0.25, 0.25, 0) + (0, 0, 1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    ground = floor(0)
    turn = rotate((0, 0, 1), 30)[:2, :2].astype(np.float32)
    ground.primvars["st"].values[:] = (ground.primvars["st"].values - 0.5) @ turn * 0.7 + 0.5
    return picture_of(
        perspective((0, 4, 3), (0, 0, 0), 45),
        meshes=[ground],
        materials=[s.Material(s.Diffuse((0.7, 0.7, 0.7)), normal=s.TextureInput(0))],
        textures=[s.Texture(n.astype(np.float32), "clamp", "clamp")],
        lights=[s.SphereLight((9, 8, 7), 0.5, translate(1.0, 3.4, 0.5))],
    )


SCENES: dict[str, Callable[[], s.Scene]] = {
    f.__name__: f
    for f in (
        diffuse, sphere_light, glass, rough_conductor, rough_glass, textured, dome, thin_lens,
        interpolated_normals, normal_map,
    )
}  # fmt: skip


BY_CHAINS = ("glass", "dome", "thin_lens")


@pytest.mark.parametrize("name", SCENES)
def test_agrees_with_mitsuba(mi, tmp_path, name: str) -> None:
    integrators = ALL if name in BY_CHAINS else BOTH
    for got in compare(mi, tmp_path, SCENES[name](), 24, 48, 64, 144, integrators):
        got.require(resolution=0.0035, block_resolution=0.015)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_agrees_with_mitsuba_with_many_samples(mi, tmp_path, name: str) -> None:
    for got in compare(mi, tmp_path, SCENES[name](), 48, 512, 2048, 1536, ALL):
        got.require(resolution=0.0025, block_resolution=0.005)
        assert abs(got.difference) < 0.005
