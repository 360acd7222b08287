"""Wrong transition densities are seen.

Each mutant leaves a factor out of T, or puts one in, as a bug would; everything else is as it is. A
mutant names the test that must see it, stationarity of one step or recorded = recomputed, and a
scene that shows it. Factors that cancel between the two ways leave the target distribution
unchanged and can be seen in what was recorded only: they would be wrong all the same for whoever
uses T by itself (f*/T estimates b).

A mutant counts as seen where p < 1e-6; what is healthy has p ≥ 1e-4 from the very same steps, or
disagrees in less than 20 % of the proposals where the mutant does in more than half.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from support.mutations import MUTATIONS, of_mutation, stationarity, steps
from usdmlt import _core

SAMPLES = 40000
# Steps from every start, where one is too few.
STEPS = {
    ("bidirectional", "pool_from_afar"): 6,
    ("lens", "mirror_floor"): 3,
    ("glossy_lens", "polished"): 8,
    ("glossy_caustic", "polished"): 4,
    ("glossy_caustic", "two_plates"): 6,
    ("lens", "thick_fog"): 2,
    ("caustic", "thick_fog"): 2,
    ("multi_chain", "milk"): 3,
    ("aimed", "mirror_floor"): 3,
    ("aimed", "mirrored_light"): 3,
    ("aimed", "polished"): 8,
}

# (mutant, mutation, scene)
SEEN_BY_STATIONARITY = [
    # The conversion of the last traced vertex to area.
    ("end_cosine", "new_path", "corridor"),
    ("end_cosine", "bidirectional", "corridor"),
    ("end_cosine", "lens", "near_lamps"),
    ("end_cosine", "caustic", "corridor"),
    ("end_cosine", "lens_subpath", "corridor"),
    ("end_distance", "new_path", "corridor"),
    ("end_distance", "bidirectional", "corridor"),
    ("end_distance", "lens", "corridor"),
    ("end_distance", "caustic", "corridor"),
    ("end_distance", "multi_chain", "mirror_floor"),
    ("end_distance", "glossy_lens", "polished"),
    ("end_distance", "glossy_caustic", "polished"),
    ("end_distance", "lens_subpath", "corridor"),
    ("end_distance", "aimed", "mirror_floor"),
    # That of the others: where chains of Dirac vertices begin, and along them.
    ("inner_conversion", "new_path", "pool_from_afar"),
    ("inner_conversion", "bidirectional", "mirrors_and_floor"),
    ("inner_conversion", "lens", "sun_caustics"),
    ("inner_conversion", "caustic", "lamp_caustics"),
    ("inner_conversion", "multi_chain", "pool"),
    ("inner_conversion", "multi_chain", "pool_through_a_lens"),
    ("inner_conversion", "multi_chain", "mirrored_light"),
    ("inner_conversion", "lens_subpath", "sun_caustics"),
    ("inner_conversion", "glossy_lens", "polished"),
    ("inner_conversion", "glossy_caustic", "polished"),
    ("inner_conversion", "aimed", "pool_from_afar"),
    # G of the joined edge, counted twice.
    ("joined_geometry", "new_path", "corridor"),
    ("joined_geometry", "bidirectional", "corridor"),
    ("joined_geometry", "lens", "corridor"),
    ("joined_geometry", "caustic", "corridor"),
    ("joined_geometry", "multi_chain", "mirrored_light"),
    ("joined_geometry", "lens_subpath", "corridor"),
    ("joined_geometry", "glossy_lens", "polished"),
    ("joined_geometry", "glossy_caustic", "polished"),
    ("joined_geometry", "aimed", "mirrored_light"),
    # 1 − α of what is passed, α of where it ends.
    ("coverage", "new_path", "veils"),
    ("coverage", "bidirectional", "veils"),
    ("coverage", "lens", "veils"),
    ("coverage", "caustic", "veils"),
    ("coverage", "lens_subpath", "veils"),
    # The margin of the raster domain, which some splits see and others do not.
    ("raster_domain", "new_path", "corridor"),
    # Densities of light points.
    ("light_point", "new_path", "near_lamps"),
    # The unit of Dirac components.
    ("dirac_measure", "new_path", "sun_caustics"),
    ("dirac_measure", "bidirectional", "pool_from_afar"),
    ("dirac_measure", "lens", "mirror_floor"),
    ("dirac_measure", "caustic", "lamp_caustics"),
    ("dirac_measure", "lens_subpath", "mirror_floor"),
    ("dirac_measure", "aimed", "mirror_floor"),
    ("lobe_choice", "new_path", "pool_from_afar"),
    ("lobe_choice", "bidirectional", "pool_from_afar"),
    ("lobe_choice", "lens_subpath", "mirrors_and_floor"),
    ("stop_choice", "lens_subpath", "lacquered_floor"),
    # Half vectors that are kept.
    ("half_vector", "glossy_lens", "polished"),
    ("half_vector", "glossy_caustic", "polished"),
    ("half_vector", "aimed", "polished"),
    # Where inner chains are aimed, and how close to that they are.
    ("stretch", "aimed", "lamp_caustics"),
    ("aimed_direction", "aimed", "lamp_caustics"),
    # Media: where rays stop by chance, which walks that keep what they had do not; distances that
    # they change; points in them, which have no cosine.
    ("collision_density", "new_path", "thick_fog"),
    ("collision_density", "bidirectional", "thick_fog"),
    ("collision_density", "lens_subpath", "thick_fog"),
    ("media_survival", "lens", "thick_fog"),
    ("media_survival", "caustic", "thick_fog"),
    ("distance_factor", "lens", "thick_fog"),
    ("distance_factor", "caustic", "thick_fog"),
    ("medium_cosine", "new_path", "thick_fog"),
    ("medium_cosine", "bidirectional", "thick_fog"),
    ("medium_cosine", "lens", "thick_fog"),
    ("medium_cosine", "caustic", "thick_fog"),
    ("medium_cosine", "lens_subpath", "thick_fog"),
    # A term for the sum.
    ("largest_split", "new_path", "corridor"),
    ("largest_split", "bidirectional", "corridor"),
    # Discrete choices.
    ("strategy_choice", "new_path", "corridor"),
    ("deletion_choice", "bidirectional", "corridor"),
    ("addition_choice", "bidirectional", "corridor"),
    ("split_count", "bidirectional", "corridor"),
    # The range of the path it came from, for the way back.
    ("forward_range", "caustic", "corridor"),
    # T taken for symmetric.
    ("symmetric", "lens", "corridor"),
    ("symmetric", "caustic", "corridor"),
    ("symmetric", "multi_chain", "mirrored_light"),
    ("symmetric", "glossy_lens", "polished"),
    ("symmetric", "glossy_caustic", "polished"),
    ("symmetric", "aimed", "lamp_caustics"),
]

SEEN_BY_WHAT_WAS_RECORDED = [
    ("end_cosine", "multi_chain", "mirrored_light"),
    ("end_cosine", "aimed", "mirrored_light"),
    ("raster_domain", "bidirectional", "near_lamps"),
    ("raster_domain", "lens_subpath", "corridor"),
    ("light_point", "bidirectional", "near_lamps"),
    ("dirac_measure", "lens", "pool"),
    ("dirac_measure", "multi_chain", "pool"),
    ("lens_point", "lens", "pool_through_a_lens"),
    ("lens_point", "multi_chain", "pool_through_a_lens"),
    ("lens_point", "aimed", "pool_through_a_lens"),
    ("media_survival", "multi_chain", "milk"),
    ("media_survival", "aimed", "milk"),
    ("distance_factor", "multi_chain", "milk"),
    ("distance_factor", "aimed", "milk"),
    # There are as many walks to choose from on the way back.
    ("start_choice", "caustic", "corridor"),
    ("start_choice", "glossy_caustic", "two_plates"),
]


@cache
def rows_of(mutation: str, scene: str) -> dict:
    needed = [
        mutant
        for mutant, *where in SEEN_BY_STATIONARITY + SEEN_BY_WHAT_WAS_RECORDED
        if where == [mutation, scene]
    ]
    rows = steps(
        scene,
        {mutation: 1.0},
        rounds=2,
        samples=SAMPLES,
        starts=SAMPLES,
        steps=STEPS.get((mutation, scene), 1),
        seed=1,
        mutants=needed,
    )
    return of_mutation(rows, mutation)


@cache
def healthy(mutation: str, scene: str) -> float:
    return stationarity(rows_of(mutation, scene))


@pytest.mark.parametrize(("mutant", "mutation", "scene"), SEEN_BY_STATIONARITY)
def test_a_step_sees(mutant: str, mutation: str, scene: str) -> None:
    assert healthy(mutation, scene) >= 1e-4
    assert stationarity(rows_of(mutation, scene), mutant) < 1e-6


def disagreeing(rows: dict, column: str) -> float:
    """Fraction of the proposals whose recorded density is not that of the column: larger than the
    sum, or not equal to it where it has one term."""
    with np.errstate(invalid="ignore"):
        difference = rows["log_recorded"] - rows[column]
    wrong = np.where(rows["terms"] == 1, np.abs(difference), difference) > 0.02
    return float(wrong.mean())


@pytest.mark.parametrize(("mutant", "mutation", "scene"), SEEN_BY_WHAT_WAS_RECORDED)
def test_the_recorded_density_sees(mutant: str, mutation: str, scene: str) -> None:
    rows = rows_of(mutation, scene)
    assert disagreeing(rows, "log_forward") < 0.2
    with np.errstate(invalid="ignore"):
        changed = np.abs(rows[mutant] - rows["log_forward"]) > 0.1
    alone = changed & (rows["terms"] == 1)
    changed = alone if alone.sum() > 100 else changed
    assert changed.sum() > 100
    rows = {k: v[changed] if isinstance(v, np.ndarray) else v for k, v in rows.items()}
    assert disagreeing(rows, mutant) > 0.5


def test_a_step_sees_selection_probabilities_left_out() -> None:
    """Some mutations apply to few paths: P(m|x) then depends on x."""
    rows = steps(
        "pool_from_afar",
        {"new_path": 1.0, "multi_chain": 10.0},
        rounds=2,
        samples=SAMPLES,
        starts=SAMPLES,
        steps=2,
        seed=1,
    )
    rows = of_mutation(rows, "new_path")
    assert stationarity(rows) >= 1e-4
    assert stationarity(rows, "selection") < 1e-6


def test_every_mutant_is_seen_somewhere() -> None:
    seen = {mutant for mutant, *_ in SEEN_BY_STATIONARITY + SEEN_BY_WHAT_WAS_RECORDED}
    assert seen >= set(_core.mutant_names())
    assert {mutation for _, mutation, _ in SEEN_BY_STATIONARITY} == set(MUTATIONS)
