"""Weights and estimates of joined subpaths against their definition from the path alone.

The integrators compute weights by recurrences along the subpaths and estimates as products of
throughputs. Here each is computed again from the finished path: p_s and f(x) vertex by vertex. The
two share the closures and lights, which have tests of their own, and nothing of the bookkeeping: a
reverse density of the wrong edge, a missing opacity, a cosine at the wrong end or a direct-light
density left out of one strategy shows as a factor.
"""

from __future__ import annotations

import numpy as np
import pytest

from support.media_scenes import LIT_SCENES
from support.rendering import build
from support.scenes import SCENES
from usdmlt import _core

# Rounding of float vertices: grazing cosines and short edges lose digits.
TOLERANCE = 2e-3


def probe(name: str, depth: int = 6, samples: int = 1000) -> dict[str, np.ndarray]:
    rows = _core.strategy_probe(build((SCENES | LIT_SCENES)[name]()), samples, depth, seed=3)
    assert len(rows["s"]) > 300
    return rows


@pytest.mark.parametrize("name", SCENES | LIT_SCENES)
def test_weights_are_those_of_the_power_heuristic(name: str) -> None:
    rows = probe(name)
    wrong = np.abs(rows["weight"] - rows["weight_by_definition"]) > TOLERANCE
    # A few paths graze a surface or an opaque edge so closely that a density is all rounding.
    assert wrong.mean() < 2e-3, np.flatnonzero(wrong)[:10]
    assert set(rows["t"]) >= {1, 2, 3}


@pytest.mark.parametrize("name", SCENES | LIT_SCENES)
def test_throughputs_are_contribution_over_density(name: str) -> None:
    rows = probe(name)
    a, b = rows["estimate"], rows["estimate_by_definition"]
    wrong = np.abs(a - b) > TOLERANCE * np.abs(b)
    assert wrong.mean() < 2e-3, np.flatnonzero(wrong)[:10]
