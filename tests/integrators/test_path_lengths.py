"""A picture is the sum of its path lengths, and each length is what it is wherever it is cut."""

from __future__ import annotations

import numpy as np
import pytest

from support import scenes
from support.rendering import BOTH, build, picture, pictures
from support.statistics import agreement


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("name", ["diffuse_box", "smooth_glass", "opacity", "dome_and_distant"])
def test_short_and_long_paths_add_up_to_the_whole(integrator: str, name: str) -> None:
    """Lengths 1…2 and 3…6 rendered apart. Sees weights that depend on the limits of length, and a
    length that is recorded on both sides or on neither."""
    built = build(scenes.build(name))
    short = pictures(built, integrator, 24, samples=24, depth=2)
    long = pictures(built, integrator, range(100, 124), samples=24, min_edges=3, depth=6)
    whole = pictures(built, integrator, range(200, 224), samples=24, depth=6)
    agreement(short + long, whole).require(resolution=0.015)


@pytest.mark.parametrize("integrator", BOTH)
def test_single_lengths_add_up_to_the_whole(integrator: str) -> None:
    built = build(scenes.build("diffuse_box"))
    each = sum(
        pictures(built, integrator, 16, samples=16, min_edges=k, depth=k) for k in range(1, 6)
    )
    whole = pictures(built, integrator, range(100, 116), samples=16, depth=5)
    agreement(each, whole).require(resolution=0.02)


@pytest.mark.parametrize("integrator", BOTH)
def test_a_hidden_background_is_hidden_from_the_camera_only(integrator: str) -> None:
    """Without background the picture is that without paths of one edge to the environment."""
    built = build(scenes.build("dome_and_distant"))
    shown = picture(built, integrator, samples=8)
    hidden = picture(built, integrator, samples=8, background=False)
    sky = picture(built, integrator, samples=8, depth=1)
    assert sky.any()
    assert shown - hidden == pytest.approx(sky, rel=1e-4, abs=1e-5)
    assert not np.array_equal(hidden, 0 * hidden)
