"""The plain Metropolis algorithm: a histogram that reproduces a grey picture.

Chains start in proportion to f, so the scaled histogram is f on average after any number of steps
if, and only if, the acceptance leaves the distribution f unchanged.
"""

from __future__ import annotations

import numpy as np
import pytest

import usdmlt
from support.statistics import Agreement, agreement
from usdmlt import plain
from usdmlt.native import core

SETS = [
    {"uniform": 1.0},
    {"row": 1.0},
    {"uniform": 0.2, "perturbation": 0.8},
    {"uniform": 0.1, "row": 0.4, "perturbation": 0.5},
]


def grey_picture() -> np.ndarray:
    """12 × 16: a bright spot on a ramp, grain by a factor of ten, two black bands.

    Darker pixels would be visited too seldom for t-tests: their histograms would be too skewed.
    """
    y, x = np.mgrid[:12, :16]
    f = 0.3 + 0.1 * y + 3 * np.exp(-((x - 4) ** 2 + (y - 7) ** 2) / 3)
    f *= 10 ** np.random.default_rng(5).uniform(-1, 0, f.shape)
    f[2:4] = 0
    f[:, 11] = 0
    return f


def pictures(f: np.ndarray, mutations: dict[str, float], seeds: int, **options) -> np.ndarray:
    """Independent histograms, scaled: (seeds, height, width, 1)."""
    done = [usdmlt.metropolis(f, mutations, seed=seed, **options) for seed in range(seeds)]
    return np.stack([d.histogram * d.scale for d in done])[..., None]


def compared(mutations: dict[str, float], f: np.ndarray, **options) -> Agreement:
    options = {"count": 20_000, "chains": 200, **options}
    return agreement(pictures(f, mutations, 200, **options), grey_picture()[..., None])


@pytest.mark.parametrize("mutations", SETS, ids="+".join)
def test_the_histogram_reproduces_the_picture(mutations: dict[str, float]) -> None:
    """200 independent histograms, t-tests of all pixels and blocks at 0.1 %.

    The mean is right by construction. An error of a pixel is seen from four of its standard errors
    on; those are 0.5 to 4 % of f.
    """
    found = compared(mutations, grey_picture())
    assert found.pixels > 1e-3, found
    assert found.blocks > 1e-3, found
    assert abs(found.difference) < 1e-12


@pytest.mark.parametrize(("chains", "count"), [(1, 50), (50, 50), (16, 160)])
def test_it_does_so_from_the_first_step(chains: int, count: int) -> None:
    """No start-up bias: a single short chain, chains of one step, and of ten."""
    f = grey_picture()[4:8, :8]
    done = pictures(f, SETS[3], 4000, chains=chains, count=count)
    found = agreement(done, f[..., None])
    assert found.pixels > 1e-3, found
    assert found.blocks > 1e-3, found


@pytest.mark.parametrize("mutations", [SETS[0], SETS[2]], ids="+".join)
def test_an_acceptance_by_another_power_is_seen(mutations: dict[str, float]) -> None:
    """min(1, (f(y)/f(x))^0.9) from the same proposals: the chain whose target is f^0.9."""
    f = grey_picture()
    wrong = pictures(f**0.9, mutations, 200, count=20_000, chains=200)
    wrong *= f.mean() / (f**0.9).mean()
    assert agreement(wrong, f[..., None]).pixels < 1e-12


@pytest.mark.parametrize("mutations", SETS, ids="+".join)
def test_an_acceptance_without_the_densities_is_seen(mutations: dict[str, float]) -> None:
    """T(y→x)/T(x→y) left out: only the mutation by rows has a T that is not symmetric."""
    f = grey_picture()
    weights = [mutations.get(name, 0.0) for name in plain.MUTATIONS]
    options = {"chains": 200, "steps": 100, "smallest_step": 0.1, "largest_step": 2.0}
    done = [
        core().plain_metropolis(f, weights=weights, seed=seed, forget_density=True, **options)
        for seed in range(200)
    ]
    wrong = np.stack([d["histogram"] * f.mean() / d["histogram"].mean() for d in done])
    found = agreement(wrong[..., None], f[..., None])
    assert found.pixels < 1e-12 if "row" in mutations else found.pixels > 1e-3


def test_scale_and_acceptance_are_what_they_say() -> None:
    f = grey_picture()
    histogram, scale, acceptance = usdmlt.metropolis(f, SETS[3], count=1000, chains=3)
    # Every step deposits 1 in all; three chains of 334 steps.
    assert histogram.sum() == pytest.approx(1002, rel=1e-12)
    assert scale == pytest.approx(f.mean() / histogram.mean(), rel=1e-12)
    assert set(acceptance) == {"uniform", "row", "perturbation"}
    assert all(0 < a < 1 for a in acceptance.values())


def test_the_acceptance_is_that_of_the_formula() -> None:
    """In equilibrium, uniform: Σ f(x)/Σf · 1/n · min(1, f(y)/f(x)). 0.5 % is five standard
    errors."""
    f = grey_picture().ravel()
    x, y = f[:, None], f[None]
    expected = np.minimum(x, y).sum() / (f.sum() * f.size)
    found = usdmlt.metropolis(grey_picture(), SETS[0], count=2_000_000, chains=20_000)
    assert found.acceptance == {"uniform": pytest.approx(expected, rel=5e-3)}


def test_a_constant_picture_accepts_everything_but_steps_over_the_edge() -> None:
    done = usdmlt.metropolis(np.ones((9, 9)), {"uniform": 1, "perturbation": 1})
    assert done.acceptance["uniform"] == 1
    assert 0.7 < done.acceptance["perturbation"] < 1


def test_the_picture_may_be_scaled_by_anything() -> None:
    f = grey_picture()
    plain_, tiny, huge = (usdmlt.metropolis(f * c, count=1000) for c in (1, 1e-200, 1e200))
    for scaled, c in ((tiny, 1e-200), (huge, 1e200)):
        np.testing.assert_allclose(scaled.histogram, plain_.histogram, rtol=1e-9)
        assert scaled.scale == pytest.approx(plain_.scale * c, rel=1e-9)


def test_seeds_differ_and_repeat() -> None:
    f = grey_picture()
    first, again, other = (usdmlt.metropolis(f, count=1000, seed=s).histogram for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize(
    "f", [np.float32([[1, 2, 3]]), [[1], [2]], [[4]], np.asfortranarray(grey_picture())]
)
def test_any_shape_and_type_of_picture(f: object) -> None:
    done = usdmlt.metropolis(f, count=2_000_000)
    # Sees transposed or shifted pictures, no more.
    np.testing.assert_allclose(done.histogram * done.scale, f, atol=0.05 * np.max(f))


@pytest.mark.parametrize(
    ("f", "complaint"),
    [
        ([[1.0, -1.0]], "f must not be negative anywhere"),
        ([[1.0, np.nan]], "f must be finite everywhere"),
        ([[1.0, np.inf]], "f must be finite everywhere"),
        (np.zeros((3, 3)), "f must not be zero everywhere"),
        (np.ones(3), "f must have two dimensions"),
        (np.ones((2, 2, 3)), "f must have two dimensions"),
        (np.ones((0, 3)), "no side of 0"),
        ([[1, 2], [3]], "f must be an array of numbers"),
        ("grey", "f must be an array of numbers"),
    ],
)
def test_pictures_that_are_no_target_are_refused(f: object, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint) as caught:
        usdmlt.metropolis(f)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"mutations": {"perturbation": 1}}, "cannot reach everything: add uniform or row"),
        ({"mutations": {"uniform": 0, "perturbation": 1}}, "cannot reach everything"),
        ({"mutations": {"uniform": 0}}, "must not all be zero"),
        ({"mutations": {}}, "must not all be zero"),
        ({"mutations": {"lens": 1}}, "unknown mutation 'lens'"),
        ({"mutations": {"uniform": 1e308, "row": 1e308}}, "too large to be added up"),
        ({"mutations": {"uniform": -1}}, "must be finite and not negative"),
        ({"mutations": 1000}, "mutations must be a mapping of names to weights"),
        ({"count": 0}, "count must be between 1 and"),
        ({"chains": 0}, "chains must be between 1 and"),
        ({"seed": -1}, "seed must be between 0 and"),
    ],
)
def test_mutations_and_counts_that_cannot_be_are_refused(options: dict, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        usdmlt.metropolis(np.ones((4, 4)), **options)


def test_the_mutations_are_those_of_the_core() -> None:
    assert core().plain_mutations == plain.MUTATIONS
