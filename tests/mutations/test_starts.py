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
from support.shapes import perspective, sphere
from usdmlt import _core
from usdmlt import scene as s


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


@pytest.mark.parametrize("scattering", [0.06, 0.6, 6.0])
def test_walks_go_on_as_light_does(scattering: float) -> None:
    """Nothing is lost in a medium of albedo 1, whatever the unit of length that its coefficients
    are per; of albedo 0.6, the rest is. The fraction that goes on is that of 512 samples."""
    size, shell = 0.6 / scattering, s.Material(s.UniformEmission((1.0, 1.0, 1.0)))
    for albedo in (1.0, 0.6):
        medium = s.Medium((albedo * scattering,) * 3, ((1 - albedo) * scattering,) * 3)
        scene = s.Scene(
            perspective((0, 0, 0), (1, 0, 0), 90), 9, 6, media=[medium], world_medium=0,
            meshes=[sphere(size, rings=12, inward=True)], materials=[shell],
        )  # fmt: skip
        probe = _core.start_probe(build(scene), samples=1, depth=12, seed=1)
        assert probe["continuation"] == pytest.approx(albedo, rel=0.05)


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
