"""The same scene, settings and seed make the same bits, whoever computes which unit when."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from support import scenes
from support.rendering import ALL, build, plan, rgba

# Four tiles, of which three are not whole.
TALL = {"width": 72, "height": 80}
COMMON = {"depth": 5, "seed": 7, "filter": "gaussian"}
# Ten units or so.
SETTINGS = {i: {"samples": n, **COMMON} for i, n in (("path", 4), ("bdpt", 4), ("mlt", 48))}


@pytest.fixture(scope="module", params=["layers", "instances"])
def built(request: pytest.FixtureRequest):
    return build(dataclasses.replace(scenes.build(request.param), **TALL))


@pytest.fixture(params=ALL)
def integrator(request: pytest.FixtureRequest) -> str:
    return request.param


def test_any_number_of_threads(built, integrator: str) -> None:
    one = rgba(built, integrator, 1, **SETTINGS[integrator])
    for threads in (2, 3):
        assert np.array_equal(one, rgba(built, integrator, threads, **SETTINGS[integrator]))


def test_any_split_of_runs(built, integrator: str) -> None:
    """Whether units are run at once, one by one or in uneven parts on other threads."""
    whole = rgba(built, integrator, 2, **SETTINGS[integrator])
    n = plan(built, integrator, **SETTINGS[integrator]).units_total
    assert n >= 8
    for cuts in (range(1, n + 1), (1, 2, n // 2 - 1, n), (n // 3, n // 3, n)):
        render = plan(built, integrator, **SETTINGS[integrator])
        for i, last in enumerate(cuts):
            assert render.run(last, 1 + i % 3) == last
        assert np.array_equal(whole, render.image())


def test_a_prefix_is_the_shorter_render(built, integrator: str) -> None:
    """Nothing depends on the number of samples that was asked for."""
    settings = SETTINGS[integrator]
    short = plan(built, integrator, **settings)
    long = plan(built, integrator, **{**settings, "samples": 4 * settings["samples"]})
    assert long.units_total > short.units_total
    short.run(short.units_total)
    long.run(short.units_total, 2)
    assert np.array_equal(short.image(), long.image())
    assert np.array_equal(short.error(), long.error())


def test_a_scene_built_again(integrator: str) -> None:
    scene = scenes.build("dome_and_distant")
    one, other = (rgba(build(scene), integrator, samples=2) for _ in range(2))
    assert np.array_equal(one, other)


def test_another_seed_is_another_picture(built, integrator: str) -> None:
    one = rgba(built, integrator, **SETTINGS[integrator])
    assert not np.array_equal(one, rgba(built, integrator, **{**SETTINGS[integrator], "seed": 8}))


def test_statistics_do_not_depend_on_threads(built, integrator: str) -> None:
    counts = []
    for threads in (1, 3):
        render = plan(built, integrator, **SETTINGS[integrator])
        render.run(render.units_total, threads)
        stats = render.stats()
        counts.append({k: stats[k] for k in ("samples", "rays", "path_length_energy")})
        counts[-1] |= {k: v for k, v in stats.get("mlt", {}).items() if "per" not in k}
    assert counts[0] == counts[1]
