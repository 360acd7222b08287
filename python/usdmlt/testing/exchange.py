"""How likely a difference is where batches may change places; see statistics.py."""

from __future__ import annotations

from collections.abc import Iterator
from statistics import NormalDist

import numpy as np

from usdmlt.testing.cells import Array, Part, parts, without_outliers
from usdmlt.testing.outcome import Evidence

MOST_SIGNS = 1 << 16
ENOUGH = 64  # sets of signs that reach S, of which p is told when the last of them is met
# Products of matrices that OpenBLAS leaves to one thread: by more, these small ones take longer.
PRODUCTS = 1 << 18
ROWS = 32


def weigh(a: Array, b: Array, cell: int, significance: float, tolerance: float) -> Evidence:
    """Exchange the batches of a and b."""
    looked_at = looks(a, b, cell, tolerance)
    p, tried = p_value(looked_at, len(a))
    limit = _score_at(looked_at, significance, len(a))
    return Evidence(p, tried, looked_at, limit, _least_t(significance, len(a)))


def looks(a: Array, b: Array, cell: int, tolerance: float) -> list[Part]:
    """Both looks at all cells, with outliers and without."""
    whole = list(parts(a, b, cell, tolerance))
    return [*whole, *parts(*without_outliers(a, b), cell, tolerance, clipped=True)]


def _signs(batches: int) -> Iterator[Array]:
    """Sets of signs, the first all +1, then the others in a fixed random order, by chunks.

    The first sign is always +1: turning all of them changes nothing. All sets where they are few.
    """
    rng = np.random.default_rng(batches)
    count = 2 ** (batches - 1)
    if count <= MOST_SIGNS:
        numbers = rng.permutation(np.arange(1, count))
    else:
        numbers = rng.integers(1, count, MOST_SIGNS - 1)
    yield np.ones((1, batches))
    start, size = 0, 128
    bits = np.arange(batches)
    while start < len(numbers):
        chunk = numbers[start : start + size]
        yield np.where((chunk[:, None] >> bits[::-1]) & 1, -1.0, 1.0)
        start, size = start + size, min(2 * size, 2048)


def _largest(cells: list[tuple[Part, Array]], signs: Array) -> Array:
    """S by set of signs, of some cells of each part."""
    scores = np.full(len(signs), -np.inf)
    columns = max(PRODUCTS // (ROWS * signs.shape[1]), 1)
    for part, x in cells:
        largest = np.zeros(len(signs))
        for i in range(0, x.shape[1], columns):
            block = np.ascontiguousarray(x[:, i : i + columns])
            for j in range(0, len(signs), ROWS):
                t = signs[j : j + ROWS] @ block
                np.maximum(largest[j : j + ROWS], t.max(axis=1), out=largest[j : j + ROWS])
                np.maximum(largest[j : j + ROWS], -t.min(axis=1), out=largest[j : j + ROWS])
        if x.shape[1]:
            scores = np.maximum(scores, part.scores(largest))
    return scores


def p_value(parts: list[Part], batches: int, enough: int = ENOUGH) -> tuple[float, int]:
    """Share of the sets of signs that reach the score of what was seen, and how many were tried.

    Cells that cannot reach it under any signs need not be looked at. No more are tried when
    ``enough`` have reached it, of the random ones: their share of those before, the last included,
    is as exact a p-value (Besag & Clifford 1991, "Sequential Monte Carlo p-values").
    """
    score = float(_largest([(part, part.x) for part in parts], np.ones((1, batches)))[0])
    able = []
    for part in parts:
        reach = np.abs(part.x).sum(axis=0)
        able.append((part, part.x[:, reach >= part.t(score) * (1 - 1e-9)]))
    reached = tried = 0
    for signs in _signs(batches):
        scores = _largest(able, signs)
        hits = np.flatnonzero(scores >= score - 1e-9 * max(abs(score), 1.0))
        missing = enough + 1 - reached  # what was seen is one of them
        if len(hits) >= missing:
            tried += int(hits[missing - 1]) + 1
            return enough / (tried - 1), tried
        reached += len(hits)
        tried += len(signs)
    return reached / tried, tried


def _score_at(parts: list[Part], significance: float, batches: int, tried: int = 384) -> float:
    """The score that noise reaches with this probability, about.

    From the highest hundredth of some sets of signs; beyond, scores fall by one when p does by e.
    """
    chunks, count = [], 0
    cells = [(part, part.x) for part in parts]
    for signs in _signs(batches):
        if count:  # the first is what was seen
            chunks.append(_largest(cells, signs))
        count += len(signs)
        if count > tried:
            break
    highest = float(np.quantile(np.concatenate(chunks), 0.99))
    return highest + float(np.log(0.01 / significance))


def _least_t(significance: float, batches: int) -> float:
    """t below which so few pairs cannot be significant: that of the same number without noise.

    Of random signs e, sum e d / sqrt(sum d^2) is about normal.
    """
    normal = NormalDist().inv_cdf(1 - significance / 2)
    return float(normal * np.sqrt((batches - 1) / max(batches - normal**2, 0.5)))
