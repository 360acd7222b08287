"""One step of every mutation, with its acceptance, leaves the target distribution unchanged.

Paths of bidirectional path tracing, resampled in proportion to their weights, take one step of
run_chain; the flows between parts of path space have to balance (see ``support.mutations``). A
wrong transition density, acceptance, selection probability or support unbalances them. What is not
seen: factors that cancel between the two ways; errors that move less than a few thousandths of the
energy in all cells looked at, and those of classes that carry little of it.

Significance: 1e-4 for each mutation in each scene. Seeds are fixed.
"""

from __future__ import annotations

import pytest

from support.class_scenes import CLASS_SCENES
from support.media_scenes import LIT_SCENES
from support.mutations import MUTATIONS, of_mutation, stationarity, steps
from support.scenes import SCENES

SIGNIFICANCE = 1e-4
ALL = dict.fromkeys(MUTATIONS, 1.0)


def require_stationarity(name: str, samples: int, **settings: object) -> None:
    """All mutations are chosen at their turn, so that P(m|x) counts as well."""
    rows = steps(name, ALL, samples=samples, starts=samples, **settings)
    told = 0
    for mutation in MUTATIONS:
        p = stationarity(of_mutation(rows, mutation))
        told += p is not None
        assert p is None or p >= SIGNIFICANCE, (mutation, p)
    assert told >= 3, "too few steps to tell"


@pytest.mark.parametrize("name", CLASS_SCENES | LIT_SCENES)
def test_a_step_leaves_the_target_distribution_unchanged(name: str) -> None:
    require_stationarity(name, 30000, rounds=2)


def test_so_it_does_without_short_paths_and_with_a_weighted_target() -> None:
    require_stationarity("mirrors_and_floor", 30000, rounds=2, min_edges=3, two_stage=True)


@pytest.mark.parametrize("name", ["mirrors_and_floor", "pool", "thick_fog"])
def test_so_it_does_with_the_target_that_the_selective_split_leaves(name: str) -> None:
    """The starts' weights have the split's part from the weights of bidirectional samples, the
    chains from the densities of finished paths. Little is left to chains: more samples find it."""
    require_stationarity(name, 60000, rounds=2, two_stage=True, selective=True)


def test_so_it_does_where_lights_are_linked() -> None:
    require_stationarity("linked_lights", 30000, rounds=2)


VARIANTS = {
    "all light": {"min_edges": 1},
    "no direct light, two stages": {"min_edges": 3, "two_stage": True},
    "the rest of a split": {"min_edges": 1, "two_stage": True, "selective": True},
}


@pytest.mark.slow
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", CLASS_SCENES | SCENES | LIT_SCENES)
def test_it_does_in_every_scene(name: str, variant: str) -> None:
    require_stationarity(name, 60000, rounds=5, steps=2, seed=1, **VARIANTS[variant])
