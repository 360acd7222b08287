"""Do two sets of independent batches show the same picture?

Pixels of a render are correlated, by pixel filters, by chains, by one normalisation of all, so no
formula says how its errors add up. Batches do: K pictures of the same thing by independent random
numbers, a_1 … a_K of the reference and b_1 … b_K of the picture that is checked. If nothing but
those numbers differs, then a_k and b_k may change places in any of the pairs and every such set is
as likely as the one that was seen. Of a statistic of the pairs' differences d_k = b_k - a_k,

    p = share of the 2^(K-1) sets of signs e for which S(e d) >= S(d)

is therefore the exact probability of a false alarm, for any distribution of the noise, whatever is
correlated, and for the largest of any number of cells (R. A. Fisher 1935; Westfall & Young 1993).
All sets of signs are too many, so a fixed random choice of 65 535 stands beside the one that was
seen, which keeps p exact: its smallest value is 1.5e-5. K is large enough for that value to be
reached by changes that some of the batches miss.

S is the largest of many scores: of every cell of a pyramid, and of patterns (see cells.py). A
cell's

    t = sum_k e_k d_k / sqrt(K s^2),    score = nu/2 log(1 + t^2/nu) - log(cells of its level),

about -log of a p-value corrected for their number, which makes levels comparable. s^2 is the
variance of the sums a_k + b_k. It is the same for all signs, and a difference of the two pictures
is not in it; small ones are drawn to those of the cells around.

Fireflies enlarge s, so a cell with one says little. All is therefore done twice, the second time
with bright outliers among the 2K values of a block cut. Neither way knows which picture a value
is from, so p stays exact. But what is cut depends on how noise is distributed. Where that may
differ although the pictures' means do not (other integrators, sample counts or versions),
``alike=False`` asks bootstrap.py instead.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from usdmlt.errors import UsageError
from usdmlt.testing import bootstrap, exchange
from usdmlt.testing.cells import LUMINANCE, Array
from usdmlt.testing.outcome import Outcome, detectable, findings, map_of

BATCHES = 24
SIGNIFICANCE = 1e-4
# Differences of a cell below this share of its brightness do not count: other compilers and
# instruction sets make such.
TOLERANCE = 1e-4


def compare_batches(
    reference: npt.NDArray[np.floating],
    picture: npt.NDArray[np.floating],
    *,
    cell: int = 1,
    significance: float = SIGNIFICANCE,
    tolerance: float = TOLERANCE,
    alike: bool = True,
) -> Outcome:
    """Test whether two sets of batches show the same; see the module.

    ``reference``, ``picture``: (batches, rows, columns, 4), linear RGB and alpha, batch k of one
    independent of batch j != k of either. ``cell``: pixels across of what is a pixel here.
    ``alike``: whether noise is distributed in one way in both; else p is approximate.
    ValueError where ``significance`` is less than so few batches, or 1 / 65 536, can show.
    """
    a, b = (np.asarray(x, dtype=np.float64) for x in (reference, picture))
    if a.shape != b.shape or a.ndim != 4:
        raise UsageError(f"batches of the shapes {a.shape} and {b.shape} cannot be compared")
    if not 0 < significance < 1:
        raise UsageError(f"significance must be between 0 and 1, not {significance:g}")
    if significance < 1 / exchange.MOST_SIGNS:
        raise UsageError(
            f"significance must be at least {1 / exchange.MOST_SIGNS:.2g}, not {significance:g}: "
            "p is not told apart further"
        )
    if 2.0 ** (1 - len(a)) > significance:
        raise UsageError(
            f"{len(a)} batches cannot show a significance of {significance:g}: "
            f"{int(np.ceil(np.log2(1 / significance))) + 1} are needed"
        )
    total = np.array([x[..., :3].mean(axis=(1, 2)) @ LUMINANCE for x in (a, b)])
    ratio, ratio_error = _ratio(total)
    same_bits = bool(np.array_equal(a, b))
    weigh = exchange.weigh if alike else bootstrap.weigh
    evidence = weigh(a, b, cell, significance, tolerance)
    p = 1.0 if same_bits else evidence.p
    by_size, whole = detectable(evidence)
    return Outcome(
        p=p,
        tried=evidence.tried,
        significance=significance,
        findings=findings(evidence) if p <= significance else [],
        ratio=ratio,
        ratio_error=ratio_error,
        detectable=whole,
        detectable_by_size=by_size,
        same_bits=same_bits,
        map=map_of(evidence, a.shape[1:3], cell),
    )


def _ratio(totals: Array) -> tuple[float, float]:
    """Ratio of the second mean to the first, and its standard error (delta method)."""
    means = totals.mean(axis=1)
    if not means[0] > 0:
        return (1.0 if means[1] == 0 else float("inf")), 0.0
    ratio = means[1] / means[0]
    rest = totals[1] - ratio * totals[0]
    return float(ratio), float(rest.std(ddof=1) / np.sqrt(len(rest)) / means[0])
