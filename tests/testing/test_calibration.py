"""False alarms of checks of real renders; `python -m support.calibration` prints the table."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from support.calibration import NAMES, interval, p_values, p_values_of, pairs, resampled
from usdmlt.testing.statistics import SIGNIFICANCE

ALIKE = ("path", "mlt")


def require_uniform(p: np.ndarray) -> None:
    """Kolmogorov-Smirnov at 1e-3; rates at 5 % and 1 % in 99.9 % intervals."""
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    for rate in (0.05, 0.01):
        low, high = interval(rate, len(p))
        assert low <= np.mean(p <= rate) <= high


@pytest.mark.parametrize("integrator", ALIKE)
def test_false_alarms_are_as_rare_as_stated(integrator: str) -> None:
    """Twelve pairs: were half of all p-values below 5 %, four times in five these would show it."""
    require_uniform(p_values(pairs("cornell_box", integrator, 12)))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ALIKE)
@pytest.mark.parametrize("name", NAMES)
def test_false_alarms_over_a_thousand_pairs(name: str, integrator: str) -> None:
    require_uniform(p_values_of(name, integrator, 1000))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ALIKE)
def test_the_default_significance_over_resampled_batches(integrator: str) -> None:
    """1e5 pictures put together from 2 400 batches: at 1e-4 ten alarms, in the 99.9 % interval."""
    alarms = resampled(pairs("cornell_box", integrator, 50), 100_000)
    low, high = stats.binom.interval(0.999, 100_000, SIGNIFICANCE)
    assert low <= alarms <= high
