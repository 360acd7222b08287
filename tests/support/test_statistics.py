"""The comparison that other tests rely on: it cries wolf as rarely as it says, and it does cry."""

from __future__ import annotations

import numpy as np
import pytest

from support.statistics import agreement, sidak


def noisy_pictures(rng: np.random.Generator, mean: np.ndarray, seeds: int = 24) -> np.ndarray:
    """Skewed noise, as pictures have it: every pixel a mean of 24 exponential samples."""
    return mean * rng.gamma(24, 1 / 24, (seeds, *mean.shape))


@pytest.fixture
def mean() -> np.ndarray:
    y, x = np.mgrid[:16, :24]
    return (0.2 + 0.5 * np.sin(0.3 * x) ** 2 + 0.02 * y)[..., None] * (1.0, 0.8, 0.5)


def test_equal_pictures_are_told_apart_as_rarely_as_stated(mean: np.ndarray) -> None:
    """At a significance of 5 %, of 400 pairs 5 % ± 4 σ are called different."""
    rng = np.random.default_rng(1)
    verdicts = np.array([
        [getattr(agreement(noisy_pictures(rng, mean), noisy_pictures(rng, mean)), q) < 0.05
         for q in ("pixels", "blocks", "mean")]
        for _ in range(400)
    ])  # fmt: skip
    # For skewed pictures with few seeds, t-tests err on the safe side.
    assert (verdicts.mean(axis=0) < 0.05 + 4 * np.sqrt(0.05 * 0.95 / 400)).all()
    assert verdicts[:, 2].mean() > 0.05 - 4 * np.sqrt(0.05 * 0.95 / 400)


def test_a_wrong_pixel_is_found(mean: np.ndarray) -> None:
    rng = np.random.default_rng(2)
    wrong = mean.copy()
    wrong[3, 5] *= 1.8
    got = agreement(noisy_pictures(rng, mean), noisy_pictures(rng, wrong))
    assert got.pixels < 1e-6
    assert got.worst[:2] == (3, 5)
    with pytest.raises(AssertionError, match="pixels differ"):
        got.require()


def test_a_faint_patch_is_found_by_its_block(mean: np.ndarray) -> None:
    rng = np.random.default_rng(3)
    wrong = mean.copy()
    wrong[4:8, 8:12] *= 1.12
    got = agreement(noisy_pictures(rng, mean), noisy_pictures(rng, wrong))
    assert got.blocks < 1e-6
    assert got.pixels > 1e-3


def test_a_small_bias_of_everything_is_found_by_the_mean(mean: np.ndarray) -> None:
    rng = np.random.default_rng(4)
    got = agreement(noisy_pictures(rng, mean), noisy_pictures(rng, 1.02 * mean))
    assert got.mean < 1e-6
    assert got.difference == pytest.approx(-0.02, abs=4 * got.resolution)


def test_noise_is_not_taken_for_agreement(mean: np.ndarray) -> None:
    rng = np.random.default_rng(5)
    few = [noisy_pictures(rng, mean, seeds=2) for _ in range(2)]
    with pytest.raises(AssertionError, match="too noisy"):
        agreement(*few).require(resolution=1e-5)


def test_pictures_without_noise_agree_to_rounding_only(mean: np.ndarray) -> None:
    still = np.repeat(mean[None], 8, axis=0)
    agreement(still, mean.astype(np.float32).astype(float)).require()
    assert agreement(still, mean * 1.001).pixels == 0
    assert agreement(0 * still + 1, np.ones_like(mean)).mean == 1


def test_rare_lumps_cry_wolf_only_if_they_are_not_told_of(mean: np.ndarray) -> None:
    """A dark corner where a lump falls once in a while: t-tests cannot judge that, but they see a
    wrong pixel where there is light all the same."""
    rng = np.random.default_rng(6)
    dark = mean.copy()
    dark[:8, :8] *= 0.01
    lumps = lambda m: 0.02 * rng.poisson(m / 0.02, (24, *m.shape))  # noqa: E731
    pairs = [(lumps(dark), lumps(dark)) for _ in range(100)]
    assert min(agreement(a, b, lumpy=True).pixels for a, b in pairs) > 1e-4
    assert min(agreement(a, b[0] * 0 + dark).pixels for a, b in pairs) < 1e-6
    dark[12, 12] *= 1.8
    assert agreement(pairs[0][0], lumps(dark), lumpy=True).pixels < 1e-6


def test_sidak() -> None:
    assert sidak(np.array([0.01])) == pytest.approx(0.01)
    assert sidak(np.full(1000, 1e-4)) == pytest.approx(1 - (1 - 1e-4) ** 1000)
    assert sidak(np.ones(5)) == 1
