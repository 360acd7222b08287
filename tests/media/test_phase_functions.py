"""Phase functions: densities over the sphere of directions, and their samplers.

Seen: a wrong norm, a wrong sign of g or of a direction, a sampler that does not follow its density,
an azimuth that favours a side. The χ² tests could miss deviations below a percent of a cell's
share. Significance: 1e-3 for all χ² tests together (Šidák); seeds are fixed.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from support.scattering import SphereGrid, random_directions, rows
from usdmlt import _core

PHASES = [
    *(("henyey_greenstein", g) for g in (-0.9, -0.5, -0.002, 0.0, 5e-4, 0.3, 0.7, 0.9)),
    ("rayleigh", 0.0),
]
KNOWN = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.36, -0.48, 0.8)]
SAMPLES = 60_000
THRESHOLD = -np.expm1(np.log1p(-1e-3) / (len(PHASES) * len(KNOWN)))

each_phase = pytest.mark.parametrize(("kind", "g"), PHASES)


def density(kind: str, g: float, known, directions: np.ndarray) -> np.ndarray:
    return _core.phase_densities(kind, g, rows(known, 1), directions)


def formula(kind: str, g: float, cosine: np.ndarray) -> np.ndarray:
    if kind == "rayleigh":
        return 3 / (16 * np.pi) * (1 + cosine**2)
    return (1 - g**2) / (4 * np.pi * (1 + g**2 - 2 * g * cosine) ** 1.5)


@each_phase
def test_densities_are_those_of_the_formulas(kind: str, g: float) -> None:
    """Straight on is −known: both directions leave the point."""
    a, b = random_directions(500, 1), random_directions(500, 2)
    expected = formula(kind, g, -(a * b).sum(1))
    assert_allclose(_core.phase_densities(kind, g, a, b), expected, rtol=2e-4)


@each_phase
def test_densities_are_reciprocal(kind: str, g: float) -> None:
    a, b = random_directions(500, 3), random_directions(500, 4)
    one, other = (_core.phase_densities(kind, g, *pair) for pair in ((a, b), (b, a)))
    assert np.array_equal(one, other)


@each_phase
def test_densities_integrate_to_one_and_have_the_mean_cosine_g(kind: str, g: float) -> None:
    known = np.array(KNOWN[2])
    grid = SphereGrid(-known * np.sign(g or 1), concentration=4.0, bins=16, sub=24)
    flux = density(kind, g, known, grid.directions) * grid.solid_angles
    assert flux.sum() == pytest.approx(1, abs=2e-4)
    assert (flux * (grid.directions @ -known)).sum() == pytest.approx(g, abs=5e-4)


@pytest.mark.parametrize("known", KNOWN, ids=["up", "down", "aslant"])
@each_phase
def test_samples_follow_the_density(kind: str, g: float, known: tuple[float, ...]) -> None:
    known = np.array(known)
    u = np.random.default_rng(5).random((SAMPLES, 2))
    directions = _core.phase_samples(kind, g, rows(known, 1), u).astype(np.float64)
    assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    concentration = 5.0 if abs(g) > 0.6 else 0.0
    grid = SphereGrid(-known * np.sign(g or 1), concentration, bins=12, sub=24)
    expected = SAMPLES * grid.per_cell(density(kind, g, known, grid.directions))
    observed = np.bincount(grid.cells(directions), minlength=expected.size)
    rare = expected < 10
    expected = np.append(expected[~rare], expected[rare].sum())
    observed = np.append(observed[~rare], observed[rare].sum())
    used = expected > 0
    result = stats.chisquare(observed[used], expected[used] * SAMPLES / expected.sum())
    assert result.pvalue > THRESHOLD
