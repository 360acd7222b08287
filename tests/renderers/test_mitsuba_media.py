"""Media as Mitsuba 3 has them: its volumetric path tracer with weights by spectrum.

As test_mitsuba: content from the same arrays, Welch's t-tests between independent seeds at the
significance 10⁻³, per pixel, per block of 4 × 4 pixels and of the mean. Grids are tracked there by
chance, integrated here; channels that differ are weighted there along whole paths.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from support.beside_mitsuba import compare
from support.media_scenes import MEDIA_SCENES, volume
from support.rendering import ALL, BOTH
from support.scenes import GREY, WHITE, picture_of
from support.shapes import box, facing, floor, perspective, rotate, translate
from usdmlt import scene as s


def fog_room() -> s.Scene:
    return MEDIA_SCENES["fog_room"]()


def glass_ball_in_fog() -> s.Scene:
    return MEDIA_SCENES["glass_ball_in_fog"]()


def milk() -> s.Scene:
    """Without the sky, which most of its light through glass would be noise of."""
    scene = MEDIA_SCENES["milk"]()
    scene.lights.pop()
    return scene


def blue_air() -> s.Scene:
    """Rayleigh's scattering in a slab whose channels differ twentyfold."""
    return picture_of(
        perspective((0, 0.8, 4), (0, -0.1, 0), 38),
        meshes=[floor(0, half=3, y=-1), box((0.2, -1, -0.8), (0.8, 0.1, -0.3), 1)],
        materials=[WHITE, GREY],
        lights=[s.RectLight((9, 9, 9), 2, 2, facing((0.5, 2.4, 0.5), (0, 0, 0)))],
        media=[s.Medium((0.05, 0.3, 1.0), (0.2, 0.02, 0.0), phase="rayleigh")],
        volumes=[volume(box((-1.3, -0.9, -1.2), (1.3, 0.9, 1.1)), 0)],
    )


def smoke() -> s.Scene:
    """A turned grid under a lamp and in sunlight."""
    values = np.random.default_rng(2).random((5, 4, 6)).astype(np.float32)
    corners = (-0.9, -0.6, -0.7), (0.9, 0.8, 0.7)
    place = rotate((0, 1, 0), 30) @ rotate((1, 0, 0), 20) @ translate(0.1, 0, 0)
    bounds = box(*corners)
    return picture_of(
        perspective((0, 0.5, 4), (0, 0, 0), 36),
        meshes=[floor(0, half=3, y=-1)],
        materials=[WHITE],
        lights=[
            s.RectLight((9, 9, 9), 1.5, 1.5, facing((-1, 2.4, 0.5), (0, 0, 0))),
            s.DistantLight((2, 2, 1.5), 0.0, facing((0, 0, 0), (0.5, -1, -0.3))),
        ],
        media=[s.Medium((2.0,) * 3, (0.5,) * 3, anisotropy=-0.3,
                        grid=s.Grid(values, *corners, place))],
        volumes=[s.Volume(bounds.points, bounds.triangles, 0, place)],
    )  # fmt: skip


SCENES: dict[str, Callable[[], s.Scene]] = {
    f.__name__: f for f in (fog_room, glass_ball_in_fog, milk, blue_air, smoke)
}


# With so few samples the light of single pixels is skewed, more than t-tests take for noise.
SKEWED = ("blocks", "mean")


@pytest.mark.parametrize("name", ["fog_room", "blue_air", "smoke"])
def test_agrees_with_mitsuba(mi, tmp_path, name: str) -> None:
    for got in compare(mi, tmp_path, SCENES[name](), 16, 16, 64, 32, BOTH):
        got.require(resolution=0.03, block_resolution=0.06, questions=SKEWED)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_agrees_with_mitsuba_with_many_samples(mi, tmp_path, name: str) -> None:
    for got in compare(mi, tmp_path, SCENES[name](), 24, 256, 1024, 512, ALL):
        got.require(resolution=0.01, block_resolution=0.03, questions=SKEWED)
