"""Twice the mutations, half the squared error.

relMSE of mlt on the ajar door, against independent halves of a picture by bidirectional path
tracing (see ``usdmlt.equal_time``), has a slope of -1 on a logarithmic scale, over a decade of
lengths. How well it is known comes from the seeds, of which every length has its own, and from the
reference, by leaving out each quarter of it in turn. The bounds are of 99 % confidence: Student's
t, with the freedom that one length has.

What does not become less with more mutations, be it a bias or errors that are not independent,
makes the slope flatter. A factor of the whole picture is not seen: pictures are scaled to one mean.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy import stats

from benchmarks.convergence import DEPTH, fit, renders
from usdmlt import equal_time
from usdmlt.stage import load

SCENE = Path(__file__).parents[2] / "scenes/door_ajar.usda"
CONFIDENCE = 0.99
Pictures = list[tuple[float, list[np.ndarray]]]  # of every length, see ``renders``


class Decade(NamedTuple):
    width: int  # in pixels
    lengths: tuple[int, ...]  # mutations per pixel
    seeds: int  # for every length
    samples: int  # per pixel, of each of the reference's batches
    darkest: float  # pixels that are looked at, by their part of the mean
    sharpness: float  # the bound is to be below that
    bias: float  # that is seen, by its part of the mean


# In a small picture a few dark pixels, with the light of one path each, would be most of the error.
QUICK = Decade(64, (32, 320), 8, 32, darkest=0.5, sharpness=0.25, bias=0.3)
LONG = Decade(96, (32, 64, 128, 256, 512), 16, 256, darkest=0.0, sharpness=0.08, bias=0.05)
DECADES = pytest.mark.parametrize("decade", [QUICK, pytest.param(LONG, marks=pytest.mark.slow)])


@functools.cache
def rendered(decade: Decade) -> tuple[Pictures, list[np.ndarray]]:
    scene = load(str(SCENE), width=decade.width)
    first = equal_time.FIRST_SEEDS["reference"]
    batches = [
        equal_time.render(scene, "bdpt", decade.samples, DEPTH, seed).picture
        for seed in range(first, first + equal_time.BATCHES)
    ]
    return list(renders(scene, decade.lengths, decade.seeds)), batches


def slope_and_error(
    pictures: Pictures, batches: list[np.ndarray], darkest: float
) -> tuple[float, float]:
    parts = equal_time.Reference("bdpt", batches, 0.0).parts
    brightness = parts[2].mean(axis=-1)
    seen = brightness >= darkest * brightness.mean()
    parts = tuple(part[seen] for part in parts)
    rows = []
    for spent, of_length in pictures:
        errors = [equal_time.relative_error(picture[seen], parts) for picture in of_length]
        rows.append((spent, *equal_time.mean_and_error(errors)))
    return fit(np.array(rows))[:2]


def slope_and_bound(
    pictures: Pictures, batches: list[np.ndarray], decade: Decade
) -> tuple[float, float]:
    """The slope, and how far from the true one it is at most, with that confidence."""
    slope, error = slope_and_error(pictures, batches, decade.darkest)
    without = [
        slope_and_error(pictures, batches[:i] + batches[i + 3 :], decade.darkest)[0]
        for i in range(0, len(batches), 3)
    ]
    of_reference = np.sqrt((len(without) - 1) * np.var(without))  # the jackknife's
    t = stats.t.ppf((1 + CONFIDENCE) / 2, decade.seeds - 1)
    return slope, float(t * np.hypot(error, of_reference))


@DECADES
def test_the_slope_is_minus_one(decade: Decade) -> None:
    pictures, batches = rendered(decade)
    slope, bound = slope_and_bound(pictures, batches, decade)
    assert bound < decade.sharpness, "too noisy to tell"
    assert abs(slope + 1) < bound


@DECADES
def test_a_constant_bias_makes_it_flatter(decade: Decade) -> None:
    pictures, batches = rendered(decade)
    biased = [(n, [p + decade.bias * p.mean() for p in of_n]) for n, of_n in pictures]
    slope, bound = slope_and_bound(biased, batches, decade)
    assert slope + 1 > bound


@DECADES
def test_mutations_made_twice_make_it_flatter(decade: Decade) -> None:
    """Half of those of every render are those of the shortest one again."""
    pictures, batches = rendered(decade)
    shortest = pictures[0][1]
    repeated = [
        (n, [(p + q) / 2 for p, q in zip(of_n, shortest, strict=True)]) for n, of_n in pictures
    ]
    slope, bound = slope_and_bound(repeated, batches, decade)
    assert slope + 1 > bound
