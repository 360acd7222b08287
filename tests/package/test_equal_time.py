"""Estimates of errors, on pictures whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

from usdmlt import benchmark, equal_time

RNG = np.random.default_rng(1)
TRUTH = RNG.uniform(0.5, 1.5, (64, 96, 3))
TRUTH /= TRUTH.mean()


def noisy(sigma: float, scale: float = 1.0) -> np.ndarray:
    noise = RNG.normal(0, sigma, TRUTH.shape)
    return scale * (TRUTH + noise - noise.mean())


def expected(sigma: float) -> float:
    return float(np.mean(sigma**2 / (TRUTH**2 + 0.01)))


def reference(sigma: float) -> equal_time.Reference:
    """Whose A, B and R have that noise; 10 times as bright as the pictures."""
    batches = [noisy(2 * sigma, 10.0) for _ in range(equal_time.BATCHES)]
    return equal_time.Reference("bdpt", batches, 1.0)


def test_noise_of_the_reference_is_not_counted() -> None:
    """As noisy as the picture, it would double the error; 5 standard errors are 4 %."""
    parts = reference(0.05).parts
    error, deviation = equal_time.mean_and_error(
        [equal_time.relative_error(noisy(0.05), parts) for _ in range(8)]
    )
    assert error == pytest.approx(expected(0.05), rel=0.04)
    assert deviation < 0.01 * error
    assert benchmark.rel_mse([noisy(0.05) for _ in range(4)]) == pytest.approx(error, rel=0.04)


def test_the_reference_knows_its_own_error_and_its_fireflies() -> None:
    clean = reference(0.05)
    assert clean.rel_mse == pytest.approx(expected(0.05), rel=0.05)
    assert clean.fireflies < 0.05
    clean.batches[0][10, 10] += 1000.0
    assert clean.fireflies > 0.9


def test_a_trimmed_error_is_that_without_fireflies() -> None:
    parts = reference(0.01).parts
    picture = noisy(0.05)
    clean = equal_time.relative_error(picture, parts)
    picture[[3, 40], [7, 50]] += 30.0
    assert equal_time.relative_error(picture, parts) > 10 * clean
    trimmed = equal_time.relative_error(picture, parts, worst=0.001)
    assert trimmed == pytest.approx(clean, rel=0.1)


def test_blocks_are_means_also_where_they_are_cut() -> None:
    picture = RNG.random((20, 33, 3))
    means = equal_time.blocks(picture)
    assert means.shape == (2, 3, 3)
    np.testing.assert_allclose(means[0, 1], picture[:16, 16:32].mean(axis=(0, 1)))
    np.testing.assert_allclose(means[1, 2], picture[16:, 32:].mean(axis=(0, 1)))


def test_blocks_see_clumps_that_pixels_do_not() -> None:
    """The same noise in every pixel of 4x4: the same error of pixels, 16 times that of blocks."""
    coarse = RNG.normal(0, 0.05, (16, 24, 3)).repeat(4, axis=0).repeat(4, axis=1)
    parts = reference(0.01).parts
    block_parts = tuple(equal_time.blocks(p) for p in parts)
    errors = []
    for picture in (TRUTH + coarse, noisy(0.05)):
        errors.append(
            (
                equal_time.relative_error(picture, parts),
                equal_time.relative_error(equal_time.blocks(picture), block_parts),
            )
        )
    (clumped, clumped_blocks), (fine, fine_blocks) = errors
    assert clumped == pytest.approx(fine, rel=0.2)
    assert clumped_blocks > 5 * fine_blocks


def test_deviations_of_blocks_are_1_where_sets_agree_and_more_where_they_do_not() -> None:
    same = equal_time.block_deviation(
        [noisy(0.05) for _ in range(8)], [noisy(0.05) for _ in range(12)]
    )
    assert 0.7 < same < 1.5
    shifted = equal_time.block_deviation(
        [noisy(0.05) + 0.02 for _ in range(8)], [noisy(0.05) for _ in range(12)]
    )
    assert shifted > 3
