"""The same scene, settings and seed make the same bits, whoever computes which unit when."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from support import scenes
from support.rendering import BOTH, build, plan, rgba

# Four tiles, of which three are not whole.
TALL = {"width": 72, "height": 80}
SETTINGS = {"samples": 4, "depth": 5, "seed": 7, "filter": "gaussian"}


@pytest.fixture(scope="module", params=["layers", "instances"])
def built(request: pytest.FixtureRequest):
    return build(dataclasses.replace(scenes.build(request.param), **TALL))


@pytest.fixture(params=BOTH)
def integrator(request: pytest.FixtureRequest) -> str:
    return request.param


def test_any_number_of_threads(built, integrator: str) -> None:
    one = rgba(built, integrator, 1, **SETTINGS)
    for threads in (2, 3):
        assert np.array_equal(one, rgba(built, integrator, threads, **SETTINGS))


def test_any_split_of_runs(built, integrator: str) -> None:
    """Whether units are run at once, one by one or in uneven parts on other threads."""
    whole = rgba(built, integrator, 2, **SETTINGS)
    for cuts in (range(1, 17), (1, 2, 7, 16), (5, 5, 16)):
        render = plan(built, integrator, **SETTINGS)
        assert render.units_total == 16
        for i, last in enumerate(cuts):
            assert render.run(last, 1 + i % 3) == last
        assert np.array_equal(whole, render.image())


def test_a_prefix_is_the_shorter_render(built, integrator: str) -> None:
    """Nothing depends on the number of samples that was asked for."""
    render = plan(built, integrator, **{**SETTINGS, "samples": 64})
    render.run(16, 2)
    assert np.array_equal(rgba(built, integrator, **SETTINGS), render.image())


def test_a_scene_built_again(integrator: str) -> None:
    scene = scenes.build("dome_and_distant")
    one, other = (rgba(build(scene), integrator, samples=2) for _ in range(2))
    assert np.array_equal(one, other)


def test_another_seed_is_another_picture(built, integrator: str) -> None:
    one = rgba(built, integrator, **SETTINGS)
    assert not np.array_equal(one, rgba(built, integrator, **{**SETTINGS, "seed": 8}))


def test_statistics_do_not_depend_on_threads(built, integrator: str) -> None:
    counts = []
    for threads in (1, 3):
        render = plan(built, integrator, **SETTINGS)
        render.run(render.units_total, threads)
        stats = render.stats()
        counts.append({k: stats[k] for k in ("samples", "rays", "path_length_energy")})
    assert counts[0] == counts[1]
