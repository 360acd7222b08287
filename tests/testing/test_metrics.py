"""Metrics against their formulas, computed another way, and against known properties."""

from __future__ import annotations

import math

import numpy as np
import pytest

from usdmlt.testing import metrics
from usdmlt.testing.metrics import Thresholds


@pytest.fixture
def pair() -> tuple[np.ndarray, np.ndarray]:
    """A picture and a reference, (6, 5, 4)."""
    rng = np.random.default_rng(1)
    reference = rng.random((6, 5, 4), dtype=np.float32)
    return reference * (1 + 0.1 * rng.standard_normal((6, 5, 4), dtype=np.float32)), reference


def test_rel_mse_and_smape_are_their_sums(pair: tuple[np.ndarray, np.ndarray]) -> None:
    picture, reference = pair
    squares, shares = [], []
    for row, column, channel in np.ndindex(6, 5, 3):
        x, r = float(picture[row, column, channel]), float(reference[row, column, channel])
        squares.append((x - r) ** 2 / (r * r + 0.01))
        shares.append(abs(x - r) / (abs(x) + abs(r) + 0.01))
    got = metrics.measure(picture, reference)
    assert got.rel_mse == pytest.approx(math.fsum(squares) / 90, rel=1e-9)
    assert got.smape == pytest.approx(math.fsum(shares) / 90, rel=1e-9)


def test_idiff_counts_pixels_with_any_channel_beyond(pair: tuple[np.ndarray, np.ndarray]) -> None:
    picture, reference = pair
    apart = np.abs(picture - reference)
    got = metrics.difference(picture, reference, fail=0.05)
    assert got.failed == np.count_nonzero((apart > 0.05).any(axis=-1))
    assert got.largest == pytest.approx(apart.max(), rel=1e-6)
    assert got.mean == pytest.approx(apart.mean(), rel=1e-5)
    assert got.rms == pytest.approx(np.sqrt((apart.astype(np.float64) ** 2).mean()), rel=1e-5)


def test_thresholds_are_those_of_idiff() -> None:
    reference = np.zeros((10, 10, 3), np.float32)
    picture = reference.copy()
    picture[0, :5] = 0.1  # 5 % of the pixels
    got = metrics.difference(picture, reference, fail=0.05)
    assert not got.exceeds(Thresholds(fail=0.05, failpercent=5))
    assert got.exceeds(Thresholds(fail=0.05, failpercent=4.9))
    assert got.exceeds(Thresholds(fail=0.05, failpercent=5, hardfail=0.09))
    assert not got.exceeds(Thresholds(fail=0.05, failpercent=5, hardfail=0.11))


def test_flip_is_nothing_for_equals_and_grows_with_the_difference() -> None:
    pytest.importorskip("flip_evaluator")
    reference = np.full((32, 32, 3), 0.4, np.float32)
    reference[:, 16:] = 0.1
    slight, strong = reference.copy(), reference.copy()
    slight[8:16, 8:16] *= 1.05
    strong[8:16, 8:16] *= 2
    means = [float(metrics.flip_map(x, reference).mean()) for x in (reference, slight, strong)]
    assert means[0] == 0 < means[1] < means[2] <= 1
    where = metrics.flip_map(strong, reference)
    assert where[8:16, 8:16].min() > 4 * where[24:, 24:].max()


def test_flip_of_a_wide_colour_space_is_that_of_the_converted_picture() -> None:
    pytest.importorskip("flip_evaluator")
    from usdmlt import color

    rng = np.random.default_rng(2)
    a, b = (0.2 + 0.5 * rng.random((16, 16, 3), dtype=np.float32) for _ in range(2))
    matrix = color.conversion("lin_rec709_scene", "lin_ap1_scene").T
    wide = [(x @ matrix).astype(np.float32) for x in (a, b)]
    expected = metrics.flip_map(a, b)
    assert np.allclose(metrics.flip_map(*wide, "lin_ap1_scene"), expected, atol=2e-3)
