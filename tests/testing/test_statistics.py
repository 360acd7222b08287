"""The test of batches, on numbers whose distribution is known."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy import stats

from usdmlt.testing import cells, exchange, statistics
from usdmlt.testing.statistics import compare_batches

K = statistics.BATCHES
SHAPE = (24, 32)


def scene() -> np.ndarray:
    """A picture (24, 32, 4) with an edge and a gradient."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] / SHAPE[1]
    rgb = (
        np.stack([0.2 + x, 0.5 + 0 * x, 0.3 + y], axis=-1) * np.where(x > 0.5, 1.0, 0.3)[..., None]
    )
    return np.concatenate([rgb, np.ones((*SHAPE, 1))], axis=-1)


def noisy(rng: np.random.Generator, picture: np.ndarray, kind: str = "gamma") -> np.ndarray:
    """Batches of a picture with unbiased noise; alpha has none."""
    size = (K, *SHAPE, 1)
    if kind == "gamma":
        factor = rng.gamma(4, 1 / 4, size)
    elif kind == "fireflies":  # a thousandth of the values has half of the light, of any colour
        hue = np.concatenate([rng.dirichlet([1, 1, 1], size[:3]) * 3, np.ones(size)], axis=-1)
        factor = 0.5 * rng.gamma(4, 1 / 4, size) + 500 * hue * (rng.random(size) < 0.001)
    elif kind == "common":  # one factor for the whole batch, as from a bootstrap
        factor = rng.gamma(50, 1 / 50, (K, 1, 1, 1)) * rng.gamma(4, 1 / 4, size)
    else:  # Cauchy: without even a mean
        factor = np.abs(rng.standard_cauchy(size))
    out = picture * factor
    out[..., 3] = picture[..., 3]
    return out.astype(np.float32)


KINDS = ["gamma", "fireflies", "common", "cauchy"]


def small(pictures: np.ndarray) -> np.ndarray:
    """A quarter of the pixels."""
    return pictures[..., ::2, ::2, :]


@pytest.mark.parametrize("kind", KINDS)
def test_p_values_are_uniform_whatever_the_noise(kind: str) -> None:
    """Kolmogorov-Smirnov at 1e-3 over 60 pairs; the rate at 5 % in its 99.9 % interval."""
    rng = np.random.default_rng(7)
    pictures = ((noisy(rng, scene(), kind), noisy(rng, scene(), kind)) for _ in range(60))
    require_uniform(np.array([compare_batches(small(a), small(b), cell=2).p for a, b in pictures]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_p_values_are_uniform_over_many_pairs(kind: str) -> None:
    """The same over 1000 pairs of all pixels."""
    rng = np.random.default_rng(8)
    pictures = ((noisy(rng, scene(), kind), noisy(rng, scene(), kind)) for _ in range(1000))
    require_uniform(np.array([compare_batches(a, b, cell=2).p for a, b in pictures]))


def require_uniform(p: np.ndarray) -> None:
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    low, high = stats.binom.interval(0.999, len(p), 0.05)
    assert low <= np.count_nonzero(p <= 0.05) <= high


def test_p_is_the_share_of_all_signs_that_reach_the_score() -> None:
    """Against every set of signs, scores computed anew from exchanged batches."""
    rng = np.random.default_rng(3)
    a, b = (noisy(rng, scene())[:8] for _ in range(2))
    b *= np.float32(1.02)
    got = compare_batches(a, b, significance=0.01)

    def score(a: np.ndarray, b: np.ndarray) -> float:
        a, b = a.astype(np.float64), b.astype(np.float64)
        parts = list(cells.parts(a, b, 1, statistics.TOLERANCE))
        parts += cells.parts(*cells.without_outliers(a, b), 1, statistics.TOLERANCE, clipped=True)
        return max(float(part.scores(np.abs(part.observed)).max()) for part in parts)

    seen, reached = score(a, b), 0
    for signs in itertools.product([False, True], repeat=7):
        swap = np.array([False, *signs])[:, None, None, None]
        reached += score(np.where(swap, b, a), np.where(swap, a, b)) >= seen * (1 - 1e-9)
    assert got.tried == 128
    assert got.p == reached / 128


def part_of(x: np.ndarray) -> cells.Part:
    """Of one cell with these differences."""
    return cells.Part("", 1, x[:, None], np.ones(1), np.ones(1), (1, 1, 1), False, K - 1.0)


def test_p_is_told_when_the_64th_set_of_signs_reaches_the_score() -> None:
    signs = np.concatenate(list(exchange._signs(K)))[1:]
    for x in np.random.default_rng(1).normal(size=(20, K)):
        reached = np.cumsum(np.abs(signs @ x) >= np.abs(x.sum()) * (1 - 1e-9))
        p, _ = exchange.p_value([part_of(x)], K)
        if reached[-1] >= 64:
            assert p == 64 / (np.searchsorted(reached, 64) + 1)
        else:
            assert p == (reached[-1] + 1) / (len(signs) + 1)


@pytest.mark.slow
def test_stopping_early_leaves_p_exact() -> None:
    """60 000 times. It has steps of 64/64, 64/65, …, of which it is spread here. Told from all sets
    that were tried until a 65th was met, at 1/2 it is off by a per cent."""
    rng = np.random.default_rng(1)
    found = [exchange.p_value([part_of(x)], K) for x in rng.normal(size=(60_000, K))]
    spread = [p - rng.random() * p / tried for p, tried in found]
    assert stats.kstest(spread, "uniform").pvalue > 1e-3


def test_what_is_the_same_is_the_same() -> None:
    a = noisy(np.random.default_rng(1), scene())
    result = compare_batches(a, a)
    assert result.p == 1 and result.same_bits and result.ratio == 1


CHANGES = {
    "brightness": lambda x: x * [1.05, 1.05, 1.05, 1],
    "one pixel": lambda x: x + (np.mgrid[: SHAPE[0], : SHAPE[1]].sum(0) == 0)[..., None] * [3] * 1,
    "colour of a block": lambda x: np.where(
        (np.arange(SHAPE[1]) // 8 == 1)[:, None], x * [1.3, 0.9, 1, 1], x
    ),
    "alpha": lambda x: x * [1, 1, 1, 0.9],
    "gamma": lambda x: np.concatenate([x[..., :3] ** 1.1, x[..., 3:]], axis=-1),
    "shift": lambda x: (x + np.roll(x, 1, axis=1)) / 2,
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_is_seen_and_its_absence_is_not(change: str) -> None:
    rng = np.random.default_rng(11)
    changed = np.broadcast_to(CHANGES[change](scene()), (*SHAPE, 4))
    assert compare_batches(noisy(rng, scene()), noisy(rng, changed)).different
    assert not compare_batches(noisy(rng, changed), noisy(rng, changed)).different


def test_a_change_of_colour_less_than_the_noise_of_brightness_is_seen() -> None:
    """Noise leaves the brightness of a block uncertain by a hundredth; two more of red are seen."""
    rng = np.random.default_rng(8)
    changed = scene()
    changed[8:16, 16:24, 0] *= 1.02
    first = compare_batches(noisy(rng, scene()), noisy(rng, changed)).findings[0]
    assert (first.what, first.size, first.x, first.y) == ("red", 8, 16, 8)


def test_a_finding_says_where_and_how_much() -> None:
    rng = np.random.default_rng(5)
    changed = scene()
    changed[8:16, 16:24] *= [1.5, 1.5, 1.5, 1]
    result = compare_batches(noisy(rng, scene()), noisy(rng, changed))
    first = result.findings[0]
    assert (first.what, first.size, first.x, first.y) == ("luminance", 8, 16, 8)
    # Of the mean of both pictures: 0.5 / 1.25.
    assert first.change == pytest.approx(0.4, abs=0.06)
    assert result.map[9:15, 17:23].min() > 2 * np.quantile(result.map, 0.7)


def test_a_brightness_ratio_comes_with_its_error() -> None:
    """Within four standard errors, and these are right: over seeds they are the spread."""
    rng = np.random.default_rng(2)
    ratios, errors = [], []
    for _ in range(40):
        a, b = (noisy(rng, scene(), "common")[:, ::4, ::4] for _ in range(2))
        result = compare_batches(a, b)
        ratios.append(result.ratio)
        errors.append(result.ratio_error)
    assert np.mean(errors) == pytest.approx(np.std(ratios), rel=0.35)
    assert abs(np.mean(ratios) - 1) < 4 * np.std(ratios) / np.sqrt(40)


def test_the_detectable_change_is_detected_nine_times_out_of_ten() -> None:
    """Binomial, 40 changes of the sizes that four pairs state: 27 or more with p = 1 - 1e-4.
    Over 160 changes of eight sizes it was 88 %."""
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(4):
        size = compare_batches(noisy(rng, scene()), noisy(rng, scene())).detectable
        assert 0.001 < size < 0.2
        factor = np.array([1 + size] * 3 + [1])
        found += sum(
            compare_batches(noisy(rng, scene()), noisy(rng, scene() * factor)).different
            for _ in range(10)
        )
    assert found >= 27


def test_a_firefly_is_no_finding_and_hides_none() -> None:
    rng = np.random.default_rng(9)
    a, b = noisy(rng, scene()), noisy(rng, scene())
    b[3, 10, 10, :3] = 5000
    assert not compare_batches(a, b).different
    # Nor does it hide that the whole picture is brighter, which it would from the mean.
    b[..., :3] *= np.float32(1.05)
    assert compare_batches(a, b).different


def test_more_fireflies_are_a_finding() -> None:
    rng = np.random.default_rng(10)
    a, b = noisy(rng, scene()), noisy(rng, scene())
    b[..., :3] += 300 * (rng.random((K, *SHAPE, 1)) < 0.002)
    assert compare_batches(a, b).different


def test_differences_within_the_tolerance_do_not_count() -> None:
    a = noisy(np.random.default_rng(1), scene())
    assert not compare_batches(a, a * np.float32(1.00005), tolerance=1e-4).different
    assert compare_batches(a, a * np.float32(1.001), tolerance=1e-4).different


def test_black_pictures_are_the_same_and_light_in_one_is_seen() -> None:
    black = np.zeros((K, *SHAPE, 4), np.float32)
    assert not compare_batches(black, black).different
    lit = black.copy()
    lit[:, 3, 4, :3] = 1
    assert compare_batches(black, lit).different


def test_too_few_batches_are_refused() -> None:
    few = np.ones((8, 4, 4, 4))
    with pytest.raises(ValueError, match=r"8 batches cannot show a significance of 0\.0001: 15"):
        compare_batches(few, few)
    with pytest.raises(ValueError, match="cannot be compared"):
        compare_batches(few, few[:, :3])
