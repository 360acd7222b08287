"""Pictures whose noise is of different kinds: alarms are rare, and changes are found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from testing.test_statistics import K, scene
from usdmlt.testing.bootstrap import DRAWS, RANKED, Tail
from usdmlt.testing.statistics import compare_batches

PICTURE = scene()[::2, ::2]


def noise(rng: np.random.Generator, kind: str) -> np.ndarray:
    """(batches, rows, columns, 1), of mean 1."""
    shape = (K, *PICTURE.shape[:2], 1)
    even = rng.gamma(4, 1 / 4, shape)
    if kind == "even":
        return rng.gamma(64, 1 / 64, shape)
    if kind == "gamma":
        return even
    if kind == "exponential":
        return rng.exponential(1, shape)
    if kind == "lognormal":  # skewness 33
        return rng.lognormal(-9 / 8, 1.5, shape)
    if kind == "fireflies":  # half of the light in a hundredth of the values
        return 0.5 * even + 50 * (rng.random(shape) < 0.01)
    return rng.gamma(4, 1 / 4, (K, 1, 1, 1)) * even  # "common" to a batch


def noisy(rng: np.random.Generator, kind: str, picture: np.ndarray = PICTURE) -> np.ndarray:
    """Batches; alpha has no noise."""
    out = picture * noise(rng, kind)
    out[..., 3] = picture[..., 3]
    return out


KINDS = ["exponential", "lognormal", "fireflies", "common"]


def require_rare(kind: str, count: int) -> None:
    """Alarms at most in the share that they are stated for: 99.9 % bounds of binomials."""
    rng = np.random.default_rng(1)
    p = [compare_batches(noisy(rng, "even"), noisy(rng, kind), alike=False).p for _ in range(count)]
    for rate in (0.05, 0.01, 1e-3, 1e-4):
        assert np.count_nonzero(np.array(p) <= rate) <= stats.binom.ppf(0.999, count, rate)


@pytest.mark.parametrize("kind", KINDS)
def test_noise_of_another_kind_is_no_difference(kind: str) -> None:
    """Of 40 pairs. By exchanges, 22 % of exponential noise was below 1 %, all of fireflies were."""
    require_rare(kind, 40)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_noise_of_another_kind_is_no_difference_in_ten_thousand_pairs(kind: str) -> None:
    require_rare(kind, 10_000)


CHANGES = {
    "brightness": ([1.15, 1.15, 1.15, 1], np.s_[:, :]),
    "a block": ([2, 2, 2, 1], np.s_[4:8, 8:12]),
    "its colour": ([1.1, 0.95, 1, 1], np.s_[4:8, 8:12]),
    "alpha": ([1, 1, 1, 0.9], np.s_[4:8, 8:12]),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_is_found(name: str) -> None:
    factor, where = CHANGES[name]
    changed = PICTURE.copy()
    changed[where] *= factor
    rng = np.random.default_rng(2)
    a, b = noisy(rng, "even"), noisy(rng, "even" if "colour" in name else "exponential", changed)
    outcome = compare_batches(a, b, alike=False)
    assert outcome.different
    assert compare_batches(b, a, alike=False).different
    first = outcome.findings[0]
    if name != "brightness":
        assert first.x + first.size >= 6 and first.x <= 12 and first.y <= 8
    if name == "a block":  # 2/3 of the mean of both
        assert first.what == "luminance" and first.change == pytest.approx(2 / 3, abs=0.2)


def test_fireflies_hide_what_is_smaller_than_they_are_and_nothing_else() -> None:
    """Of single pixels nothing can be told; that the whole picture is a fifth as bright can.

    At 1 %: forty fireflies are all that there is to tell it by.
    """
    rng = np.random.default_rng(3)
    darker = noisy(rng, "even", PICTURE * [0.2, 0.2, 0.2, 1])
    outcome = compare_batches(darker, noisy(rng, "fireflies"), alike=False, significance=0.01)
    assert outcome.different
    assert outcome.detectable_by_size[16] < 3 < 50 < outcome.detectable_by_size[1]


def test_the_detectable_change_is_detected() -> None:
    """Stated for nine in ten, of noise with little skewness; fewer than 22 of 30 have p < 0.01."""
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(3):
        size = compare_batches(noisy(rng, "even"), noisy(rng, "gamma"), alike=False).detectable
        changed = PICTURE * np.array([1 + size] * 3 + [1])
        for _ in range(10):
            a, b = noisy(rng, "even"), noisy(rng, "gamma", changed)
            found += compare_batches(a, b, alike=False).different
    assert found >= 22


def test_the_same_is_the_same() -> None:
    a = noisy(np.random.default_rng(5), "even")
    outcome = compare_batches(a, a, alike=False)
    assert outcome.p == 1 and not outcome.findings


@pytest.mark.parametrize("name", ["exponential", "pareto"])
def test_a_tail_is_continued_as_it_began(name: str) -> None:
    """-log p of ten times fewer than the draws, to a fifth, on average over 200 sets of draws."""
    rng = np.random.default_rng(6)
    draw, quantile = {
        "exponential": (rng.exponential, lambda p: -np.log(p)),
        "pareto": (lambda size: rng.pareto(4, size), lambda p: p**-0.25 - 1),
    }[name]
    p = 0.1 / DRAWS
    tails = [Tail.of(draw(size=DRAWS)) for _ in range(200)]
    got = np.mean([tail.minus_log_p(quantile(p)) for tail in tails])
    assert got == pytest.approx(-np.log(p), rel=0.2)
    for tail in tails[:5]:
        for minus_log_p in (0.5, 2.0, np.log(DRAWS / RANKED) - 0.1, 9.0, 15.0):
            assert tail.minus_log_p(tail.score(minus_log_p)) == pytest.approx(minus_log_p, abs=0.02)
