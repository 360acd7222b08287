"""Media that are not met leave pictures as they are.

A tiny body of a clear medium in a corner turns on all that media need. Paths from the eye in scenes
without partial opacity, short enough to need no roulette, take all their random numbers from
elsewhere than media do, and so every bit of the picture has to stay: weights, densities and lengths
of edges through nothing are those of edges without media.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from support import scenes
from support.media_scenes import volume
from support.rendering import rgba
from support.shapes import box
from usdmlt import scene as s


@pytest.mark.parametrize("name", ["diffuse_box", "glossy", "smooth_glass", "caustics", "thin_lens"])
def test_clear_media_leave_every_bit_as_it_is(name: str) -> None:
    scene = scenes.build(name)
    speck = volume(box((0.9, 0.9, 0.9), (0.91, 0.91, 0.91)), 0)
    with_media = replace(scene, media=[s.Medium()], volumes=[speck])
    one, other = (rgba(x, "path", samples=8, depth=5) for x in (scene, with_media))
    assert one[..., :3].any()
    assert np.array_equal(one, other)


def test_a_clear_world_is_no_fog() -> None:
    scene = scenes.build("dome_and_distant")
    in_clear_air = replace(scene, media=[s.Medium()], world_medium=0)
    one, other = (rgba(x, "path", samples=8, depth=5) for x in (scene, in_clear_air))
    assert np.array_equal(one, other)
