"""`auto` takes the integrator that suits the scene, says so, and takes the same again."""

from __future__ import annotations

import logging

import pytest

import usdmlt
from usdmlt import native
from usdmlt.choice import PILOT_RAYS, RAYS_PER_SAMPLE, SHARE, Choice, choose
from usdmlt.cli.bench import shipped_scenes
from usdmlt.settings import Settings

SCENES = {path.rsplit("/", 1)[-1].removesuffix(".usda"): path for path in shipped_scenes()}


def choice(name: str, **settings: object) -> Choice:
    scene = usdmlt.load(SCENES[name], width=256)
    return choose(native.build_scene(scene, "avx2"), Settings(**{"samples": 256, **settings}))


@pytest.mark.parametrize("name", ["pool", "caustics", "small_aperture"])
def test_light_that_is_hard_to_find_is_left_to_the_chains(name: str) -> None:
    assert choice(name).integrator == "mlt"


@pytest.mark.parametrize("name", ["cornell_box", "gallery"])
def test_easy_light_is_not(name: str) -> None:
    chosen = choice(name)
    assert chosen.integrator in ("path", "bdpt")
    assert chosen.merit[chosen.integrator] < chosen.merit["mlt"]


def test_the_choice_is_the_same_on_any_number_of_threads() -> None:
    assert choice("caustics", threads=1) == choice("caustics", threads=3)


def test_pilots_are_a_small_part_of_the_work() -> None:
    chosen = choice("cornell_box")
    assert 0 < chosen.rays <= SHARE * 256 * 256**2 * RAYS_PER_SAMPLE
    assert chosen.rays <= PILOT_RAYS


@pytest.mark.parametrize(("samples", "integrator"), [(4, "bdpt"), (32, "mlt")])
def test_short_renders_have_no_pilots(samples: int, integrator: str) -> None:
    """What could be hard is left to the chains, where these have time to begin."""
    chosen = choice("pool", samples=samples)
    assert (chosen.integrator, chosen.rays) == (integrator, 0)


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_what_was_asked_for_is_taken(integrator: str) -> None:
    assert choice("pool", integrator=integrator).integrator == integrator


def test_asking_for_mutations_is_asking_for_chains() -> None:
    assert choice("cornell_box", samples=None, mutations=8).integrator == "mlt"


def test_direct_light_alone_is_path_traced() -> None:
    assert choice("pool", depth=2).integrator == "path"


def test_it_is_said_what_was_chosen(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "usdmlt"):
        image = usdmlt.render(SCENES["pool"], width=64, samples=4)
    assert "auto: bdpt (the render is too short" in caplog.text
    assert image.stats["choice"]["integrator"] == "bdpt"


def test_a_picture_of_one_row_has_pilots_too() -> None:
    scene = usdmlt.load(SCENES["cornell_box"], width=16384, height=1)
    chosen = choose(native.build_scene(scene, "avx2"), Settings(samples=512, depth=4))
    assert chosen.rays > 0
