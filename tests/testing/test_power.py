"""What checks have to find whatever the random numbers are, by path tracing of 64 x 64 pixels."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from benchmarks.check_power import CASES, Case, lights, render
from usdmlt.rendering import no_warnings
from usdmlt.testing.statistics import Outcome, compare_batches

# So small, p is 1e-3 or more of these. They have the benchmark.
FAINT = ("lights 1 % brighter", "a ball in the shade: red +10 %")
SURE = {name: case for name, case in CASES.items() if name not in ("nothing", *FAINT)}
SURE["lights 3 % brighter"] = Case("cornell_box", lights(1.03))


@functools.cache
def picture(case: Case, stream: int, changed: bool) -> np.ndarray:
    """Batches of a case."""
    with no_warnings():
        options = {"integrator": "path", "stream": stream}
        return render(case, changed=changed, width=64, **options).pictures


def outcome(case: Case, changed: bool) -> Outcome:
    """Of two pictures by different random numbers."""
    reference = Case(case.scene, both=case.both)
    return compare_batches(picture(reference, 0, False), picture(case, 1, changed))


@pytest.mark.parametrize("name", SURE)
def test_a_change_of_a_scene_is_found(name: str) -> None:
    assert outcome(SURE[name], changed=True).p < 1e-4


def test_a_scene_without_a_change_passes() -> None:
    assert outcome(CASES["nothing"], changed=True).p > 1e-3


def test_a_ball_of_another_red_is_found_as_such() -> None:
    """In the place of the ball, and ten per cent, of which its neighbours have some."""
    first = outcome(SURE["a ball in the light: red +10 %"], changed=True).findings[0]
    assert first.what == "red"
    assert first.change == pytest.approx(0.11, abs=0.04)
    assert 20 <= first.x <= 28 and 20 <= first.y <= 28
