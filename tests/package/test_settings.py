"""Settings: defaults, and one line for what cannot be."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from usdmlt import Rendering, Settings, load
from usdmlt.settings import MUTATIONS, check_resolution


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"samples": 0}, "samples must be between 1 and"),
        ({"samples": 1.5}, "samples must be an integer"),
        ({"samples": True}, "samples must be an integer"),
        ({"depth": 0}, "depth must be between 1 and"),
        ({"seed": -1}, "seed must be between 0 and"),
        ({"seed": 2**32}, "seed must be between 0 and"),
        ({"threads": 0}, "threads must be between 1 and"),
        ({"time": 0}, "time must be a positive number"),
        ({"time": float("nan")}, "time must be a positive number"),
        ({"time": float("inf")}, "time must be a positive number"),
        ({"time": "10"}, "time must be a positive number of seconds, not '10'"),
        ({"time": True}, "time must be a positive number"),
        ({"target_error": 0}, "target_error must be a positive number"),
        ({"target_error": "2%"}, "target_error must be a positive number"),
        ({"two_stage": "no"}, "two_stage must be True or False, not 'no'"),
        ({"integrator": "mlt2"}, "integrator must be one of auto, path, bdpt, mlt"),
        ({"mutations": 0}, "mutations must be between 1 and"),
        ({"mutations": 4, "samples": 4}, "samples and mutations say the same"),
        ({"mutations": 4, "integrator": "path"}, "mutations are for mlt, not for path"),
        ({"mutation_weights": {"new_path": 1}, "integrator": "bdpt"}, "are for mlt, not for bdpt"),
        ({"mutation_weights": ["lens"]}, "must be a mapping of names to weights"),
        ({"mutation_weights": {}}, "must not all be zero"),
        ({"mutation_weights": {"lense": 1}}, "unknown mutation 'lense': the mutations are new_"),
        ({"mutation_weights": {"lens": -0.1}}, "lens must be finite and not negative"),
        ({"mutation_weights": {"lens": float("inf")}}, "lens must be finite and not negative"),
        ({"mutation_weights": {"new_path": 1e308, "lens": 1e308}}, "too large to be added up"),
        ({"mutation_weights": {"lens": "1"}}, "the weight of lens must be a number"),
        ({"mutation_weights": {"new_path": 0, "lens": 0}}, "must not all be zero"),
        ({"mutation_weights": {"new_path": 0, "lens": 1}}, "add new_path or bidirectional"),
        ({"direct": "both"}, "direct must be one of auto, mlt, separate"),
        ({"embree_isa": "neon"}, "embree_isa must be one of sse2,"),
        ({"filter": "sinc"}, "filter must be one of gaussian, box"),
    ],
)
def test_values_out_of_range_are_named(settings: dict, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        Settings(**settings)


@pytest.mark.parametrize("size", [(0, None), (None, 0), (-4, 4), (4, 2**20)])
def test_impossible_image_sizes_are_refused(size: tuple[int | None, int | None]) -> None:
    with pytest.raises(ValueError, match=r"(width|height) must be between 1 and"):
        check_resolution(*size)


def test_the_mutations_are_those_of_the_core(stage: Path) -> None:
    rendering = Rendering(load(stage, width=8), Settings(integrator="mlt"))
    assert tuple(rendering.stats()["mutation"]) == MUTATIONS


def test_mutations_are_samples_of_mlt() -> None:
    assert Settings(mutations=8).resolved_samples == 8
    assert Settings(integrator="mlt", samples=8).resolved_samples == 8
    assert Settings(integrator="mlt").resolved_samples == 64


def test_weights_are_kept_as_numbers_by_name() -> None:
    weights = {"lens": np.float32(0.5), "bidirectional": 1}
    assert Settings(mutation_weights=weights).mutation_weights == {
        "lens": 0.5,
        "bidirectional": 1.0,
    }


def test_samples_default_to_64_and_are_unlimited_under_a_time_limit() -> None:
    assert Settings().resolved_samples == 64
    assert Settings(time=1.0).resolved_samples >= 2**20
    assert Settings(time=1.0, samples=16).resolved_samples == 16


def test_numpy_integers_are_integers() -> None:
    assert Settings(samples=np.int64(3)).resolved_samples == 3


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs CPU affinity")
def test_threads_follow_the_affinity_of_the_process() -> None:
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        assert Settings().resolved_threads == 1
    finally:
        os.sched_setaffinity(0, allowed)
    assert Settings().resolved_threads == len(allowed)
