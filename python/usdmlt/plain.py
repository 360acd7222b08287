"""The plain Metropolis algorithm on a 2-D array, by the driver that renders.

A chain that walks over a grey picture and accepts its steps by a(x→y) = min(1, f(y) T(y→x) /
(f(x) T(x→y))) spends a time in each pixel that is proportional to f: its histogram is the picture,
but for a scale (Metropolis et al. 1953; Veach & Guibas 1997, section 2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from usdmlt.errors import UsageError
from usdmlt.native import core
from usdmlt.settings import check_integer, check_weights

MUTATIONS = ("uniform", "row", "perturbation")
ERGODIC_MUTATIONS = ("uniform", "row")
DEFAULT_WEIGHTS = MappingProxyType({"uniform": 0.2, "perturbation": 0.8})

# The steps of a perturbation are those that Veach has for the lens perturbation: from a tenth of a
# pixel to the radius of a disc of a twentieth of the picture.
SMALLEST_STEP = 0.1
LARGEST_STEP_AREA = 0.05
MUTATIONS_PER_PIXEL = 64


class Histogram(NamedTuple):
    """What chains over a picture f leave; ``histogram * scale`` has f as its expected value.

    ``histogram``: (height, width) float64, steps spent in each pixel; a step that is accepted with
    probability a counts 1 - a where it started and a where it went. Its sum is the number of
    mutations. ``scale``: the mean of f over the mean of the histogram. ``acceptance``: the mean
    acceptance probability of every mutation that was tried, what left the picture being 0.
    """

    histogram: npt.NDArray[np.float64]
    scale: float
    acceptance: dict[str, float]


def metropolis(
    f: npt.ArrayLike,
    mutations: Mapping[str, float] = DEFAULT_WEIGHTS,
    *,
    count: int | None = None,
    chains: int = 64,
    seed: int = 0,
) -> Histogram:
    """Reproduce a grey picture as the histogram of Markov chains.

    ``f``: (height, width), finite, not negative and not zero everywhere.
    ``mutations``: how often each is tried, relative to the others: ``"uniform"`` proposes any
    point of the picture; ``"row"`` a row in proportion to its light, and any point of it;
    ``"perturbation"`` a point nearby, at a log-uniform distance between a tenth of a pixel and the
    radius of a disc of 5 % of the picture; where that is outside, the step is rejected. One of the
    first two has to be there.
    ``count``: mutations in all, rounded up to fill the chains; None: 64 per pixel.
    ``chains``: independent ones, each of which starts at a point drawn in proportion to f.
    ``seed``: from 0 below 2^32; the same arguments give the same bits.

    Raises ValueError for a picture, or mutations, that cannot be.

    >>> histogram, scale, acceptance = usdmlt.metropolis([[1, 2], [3, 0]])
    >>> (histogram * scale).round()
    array([[1., 2.],
           [3., 0.]])
    """
    picture = _picture(f)
    weights = check_weights("mutations", mutations, MUTATIONS, ERGODIC_MUTATIONS)
    check_integer("chains", chains, 1, 2**32)
    check_integer("seed", seed, 0, 2**32 - 1)
    check_integer("count", count, 1, 2**62, optional=True)
    if count is None:
        count = MUTATIONS_PER_PIXEL * picture.size
    largest = float(picture.max())
    radius = math.sqrt(LARGEST_STEP_AREA * picture.size / math.pi)
    done = core().plain_metropolis(
        picture / largest,
        weights=[weights.get(name, 0.0) for name in MUTATIONS],
        chains=chains,
        steps=-(-count // chains),
        seed=seed,
        smallest_step=SMALLEST_STEP,
        largest_step=max(radius, 2 * SMALLEST_STEP),
    )
    histogram: npt.NDArray[np.float64] = done["histogram"]
    scale = float((picture / largest).mean() / histogram.mean()) * largest
    return Histogram(histogram, scale, done["acceptance"])


def _picture(f: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """f as float64; ValueError for what no chain can have as its target."""
    try:
        picture = np.array(f, np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise UsageError(f"f must be an array of numbers: {error}") from error
    if picture.ndim != 2 or picture.size == 0:
        raise UsageError(f"f must have two dimensions and no side of 0, not {picture.shape}")
    if not np.isfinite(picture).all():
        raise UsageError("f must be finite everywhere")
    if (picture < 0).any():
        raise UsageError("f must not be negative anywhere")
    if not picture.any():
        raise UsageError("f must not be zero everywhere")
    return picture
