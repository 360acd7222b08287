"""The energy of every class of path: chains against bidirectional samples and paths from the eye.

A class is the string of components, L D S … E. The picture's mean cannot tell how light is shared
between classes, and a wrong acceptance may move it from one to another: here each class has its own
t-test over independent seeds, Šidák's correction counting the classes of a scene, at the
significance 10⁻³. What is asked of the resolution says that in every class of 10 % of the energy or
more a difference of 4 × 4 % would be seen (4 × 2 % in the slow version). References are summed by
the components that subpaths sampled, not by the chains' way to name a path. Paths from the eye that
meet light by chance have no joins and no weights in them.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy import stats

from support import transport_scenes
from support.rendering import build, plan
from support.statistics import sidak
from usdmlt.native import core

DEPTH = 6
LEAST = 2e-3  # classes of less energy are put together
DIRAC_SUNS = {"suns_through_glass"}  # which no path from the eye meets by chance


def of_chains(built, seed: int, mutations: int, **settings: object) -> dict[str, float]:
    """Of chains alone, unless the settings say otherwise."""
    settings = {"selective": False, **settings}
    render = plan(built, "mlt", samples=mutations, depth=DEPTH, seed=seed, **settings)
    render.run(render.units_total)
    found = render.stats()["mlt"]["path_class_energy"]
    assert found.pop("other", 0) == 0
    return found


@cache
def reference(name: str, seeds: int, samples: int, bidirectional: bool) -> list[dict[str, float]]:
    built = build(transport_scenes.build(name))
    return [
        core().class_energies(built, samples, DEPTH, seed, bidirectional)
        for seed in range(1000, 1000 + seeds)
    ]


def tabulate(tables: list[dict[str, float]], classes: list[str]) -> np.ndarray:
    """(seeds, classes and the rest)."""
    rows = [[t.get(c, 0.0) for c in classes] for t in tables]
    rest = [sum(t.values()) - sum(row) for t, row in zip(tables, rows, strict=True)]
    return np.column_stack([rows, rest])


def compare(
    one: list[dict[str, float]], other: list[dict[str, float]], resolution: float
) -> dict[str, tuple[float, float, float]]:
    """Fails where classes differ, or noise hides it; shares, differences and their errors."""
    classes = sorted({c for table in (*one, *other) for c in table})
    total = np.mean([sum(t.values()) for t in other])
    mean = lambda c: np.mean([t.get(c, 0.0) for t in (*one, *other)])  # noqa: E731
    classes = [c for c in classes if mean(c) > LEAST * total]
    a, b = tabulate(one, classes), tabulate(other, classes)
    with np.errstate(invalid="ignore"):
        p = stats.ttest_ind(a, b, axis=0, equal_var=False).pvalue
    p = np.where((a == 0).all(0) & (b == 0).all(0), 1.0, p)
    share = b.mean(0) / total
    difference = (a.mean(0) - b.mean(0)) / total
    error = np.sqrt(a.var(0, ddof=1) / len(a) + b.var(0, ddof=1) / len(b)) / total
    names = [*classes, "the rest"]
    rows = {n: (share[i], difference[i], error[i]) for i, n in enumerate(names)}
    table = "\n".join(f"{n:10} {x:7.4f} {d:+8.4f} ± {e:.4f}" for n, (x, d, e) in rows.items())
    large = share > 0.1
    assert (error[large] <= resolution * share[large]).all(), f"too noisy to tell:\n{table}"
    print(table)
    assert sidak(p) >= 1e-3, f"p = {sidak(p):.2g} at {names[int(np.nanargmin(p))]}:\n{table}"
    return rows


@pytest.mark.parametrize("selective", [False, True], ids=["all by chains", "split"])
@pytest.mark.parametrize("name", ["mirror_caustic_through_a_lens", "pool"])
def test_classes_have_the_energy_of_bidirectional_samples(name: str, selective: bool) -> None:
    """Three edges and more."""
    built = build(transport_scenes.build(name))
    settings = {"direct": "separate", "selective": selective}
    chains = [of_chains(built, seed, 192, **settings) for seed in range(16)]
    other = [
        {c: e for c, e in t.items() if len(c) > 3}
        for t in reference(name, 16, 40_000, bidirectional=True)
    ]
    rows = compare(chains, other, resolution=0.04)
    assert len(rows) > 4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("two_stage", "selective"), [(False, False), (True, False), (True, True)],
    ids=["one stage", "two stages", "split"],
)  # fmt: skip
@pytest.mark.parametrize("name", transport_scenes.TRANSPORT_SCENES)
def test_all_classes_have_the_energy_of_both_other_methods(
    name: str, two_stage: bool, selective: bool
) -> None:
    """From LE on, 24 seeds each."""
    built = build(transport_scenes.build(name))
    settings = {"direct": "mlt", "two_stage": two_stage, "selective": selective}
    chains = [of_chains(built, seed, 1024, **settings) for seed in range(24)]
    compare(chains, reference(name, 24, 300_000, bidirectional=True), resolution=0.02)
    if name not in DIRAC_SUNS:
        compare(chains, reference(name, 24, 600_000, bidirectional=False), resolution=0.02)
