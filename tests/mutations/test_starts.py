"""Starts of chains: bidirectional samples and finished paths mean the same target.

Selective split and roulette are functions of the path, written twice: from the weight of a sample
while its walks are known, and from the densities of a finished path.

Starts that were drawn many times are spread, which must not move light (see ``support.mutations``
for the test; p of what is right is at least 1e-4, that of the mutant below 1e-6).
"""

from __future__ import annotations

import numpy as np
import pytest

from support.class_scenes import CLASS_SCENES
from support.media_scenes import LIT_SCENES
from support.mutations import MUTATIONS, build_scene, stationarity
from support.rendering import build
from usdmlt import _core


@pytest.mark.parametrize("name", CLASS_SCENES | LIT_SCENES)
def test_a_sample_s_weight_is_that_of_its_path(name: str) -> None:
    probe = _core.start_probe(build((CLASS_SCENES | LIT_SCENES)[name]()), samples=4000, seed=1)
    assert probe["selective"] and len(probe["weight"]) > 100
    wrong = np.abs(probe["weight"] / probe["expected"] - 1)
    assert (wrong > 1e-3).mean() < 2e-3  # rounding of float vertices at grazing angles
    # In media edges may be so short that their direction is all rounding.
    assert (wrong > 0.05).sum() <= 2 * (name in LIT_SCENES)
    if name == "corridor":
        assert probe["continuation"] < 1
        assert np.bincount(probe["roulettes"])[1:4].min() > 10


@pytest.mark.parametrize("within_band", [True, False])
def test_starts_stay_fair_while_they_are_spread(within_band: bool) -> None:
    """As units draw and spread them; a third of a start for each sample makes many that are drawn
    often. Leaving the band, as they would without what keeps them in it, takes their light to where
    lighter starts are."""
    rows = _core.spread_probe(
        build_scene("polished"), dict.fromkeys(MUTATIONS, 1.0), rounds=2, samples=20000,
        starts=6000, seed=1, within_band=within_band,
    )  # fmt: skip
    moved = rows["raster_x_before"] != rows["raster_x_after"]
    assert moved.mean() > 0.5
    p = stationarity(rows)
    assert p >= 1e-4 if within_band else p < 1e-6
