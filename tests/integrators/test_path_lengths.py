"""A picture is the sum of its path lengths, and each length is what it is wherever it is cut."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from support import scenes
from support.rendering import ALL, BOTH, build, picture, pictures, rgba, work
from support.statistics import agreement


@pytest.mark.parametrize(
    ("integrator", "name"),
    [
        *((i, n) for i in BOTH for n in ("diffuse_box", "smooth_glass", "opacity")),
        *((i, "dome_and_distant") for i in BOTH),
        ("mlt", "opacity"),
    ],
)
def test_short_and_long_paths_add_up_to_the_whole(integrator: str, name: str) -> None:
    """Lengths 1…2 and 3…6 rendered apart. Sees weights that depend on the limits of length, and a
    length that is recorded on both sides or on neither."""
    built = build(scenes.build(name))
    settings = work(integrator, 6 if integrator == "mlt" else 24)
    short = pictures(built, integrator, 24, depth=2, **settings)
    long = pictures(built, integrator, range(100, 124), min_edges=3, depth=6, **settings)
    whole = pictures(built, integrator, range(200, 224), depth=6, **settings)
    agreement(short + long, whole, lumpy=integrator == "mlt").require(resolution=0.015)


@pytest.mark.parametrize("integrator", ALL)
def test_single_lengths_add_up_to_the_whole(integrator: str) -> None:
    built = build(scenes.build("diffuse_box"))
    settings = work(integrator, 4 if integrator == "mlt" else 16)
    each = sum(
        pictures(built, integrator, 16, min_edges=k, depth=k, **settings) for k in range(1, 6)
    )
    whole = pictures(built, integrator, range(100, 116), depth=5, **settings)
    agreement(each, whole, lumpy=integrator == "mlt").require(resolution=0.02)


@pytest.mark.parametrize("integrator", ALL)
def test_a_scene_can_hide_its_background_itself(integrator: str) -> None:
    """As that of the settings: the lights of a scene without a background of its own."""
    scene = scenes.build("dome_and_distant")
    hidden = picture(scene, integrator, samples=8, background=False)
    other = picture(dataclasses.replace(scene, background=False), integrator, samples=8)
    assert picture(scene, integrator, samples=8, depth=1).any(), "there is a sky to hide"
    assert np.array_equal(hidden, other)


@pytest.mark.parametrize("integrator", BOTH)
def test_a_hidden_background_is_hidden_from_the_camera_only(integrator: str) -> None:
    """Without background the picture is that without paths of one edge to the environment."""
    built = build(scenes.build("dome_and_distant"))
    settings = {"samples": 8}
    shown = picture(built, integrator, **settings)
    hidden = picture(built, integrator, background=False, **settings)
    sky = picture(built, integrator, depth=1, **settings)
    assert sky.any()
    assert shown - hidden == pytest.approx(sky, rel=1e-4, abs=1e-5)
    assert not np.array_equal(hidden, 0 * hidden)


def test_chains_do_not_see_a_hidden_background_either() -> None:
    """Between geometry there is nothing; elsewhere the same light."""
    built = build(scenes.build("dome_and_distant"))
    settings = {"samples": 64, "direct": "mlt"}
    shown = rgba(built, "mlt", **settings)
    hidden = rgba(built, "mlt", background=False, **settings)
    alpha = rgba(built, "path", samples=512, depth=1)[..., 3]
    sky, covered = alpha == 0, alpha == 1
    assert sky.any()
    assert not hidden[sky].any()
    assert (shown[sky, :3] > 0).all()
    light = hidden[covered, :3].mean()
    assert light == pytest.approx(shown[covered, :3].mean(), rel=0.05)
