"""Do two pictures with error layers show the same? What can be said without batches.

Errors by pixel do not say how those of neighbours hang together. Here the pictures' difference d,
in units of its standard error by pixel, tells that itself: at every size of cells, the median of
|z| over all cells says by how much z is wider than a normal number, and z is divided by that. It
holds while most of the picture is unchanged. So does the answer: a p-value that is about right, and
blind to changes of the whole picture where the errors may have a common part, as those of
Metropolis light transport do.

The layer is of luminance Y = sum w_c x_c. Where noise of the colours is not against each other, the
error of x_c is at most that of Y over w_c; that of alpha, a share of the samples, is at most
sqrt(alpha (1 - alpha)). So changes of these have to be larger to be found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from usdmlt.testing.cells import CHANNELS, FAINT, LUMINANCE, Array, halved, local_median
from usdmlt.testing.outcome import Finding, Outcome
from usdmlt.testing.statistics import SIGNIFICANCE

FREEDOM = 15.0  # of an error from sixteen units or samples; most are from more
FEWEST_CELLS = 32  # from which a median is told
MEDIAN = 0.6745  # of |z| of a standard normal number


def compare_pictures(
    reference: npt.NDArray[np.floating],
    reference_error: npt.NDArray[np.floating],
    picture: npt.NDArray[np.floating],
    picture_error: npt.NDArray[np.floating],
    *,
    common: bool,
    significance: float = SIGNIFICANCE,
) -> Outcome:
    """Test (rows, columns, 4), RGB and alpha, by the errors of their luminance; see the module.

    What is not finite counts as 0.
    """
    a, b = (_finite(x) for x in (reference, picture))
    errors = [_finite(x) for x in (reference_error, picture_error)]
    luminance = a[..., :3] @ LUMINANCE, b[..., :3] @ LUMINANCE
    compared = [("luminance", *luminance, *errors)]
    for c, (name, weight) in enumerate(zip(CHANNELS[1:4], LUMINANCE, strict=True)):
        compared.append((name, a[..., c], b[..., c], *(error / weight for error in errors)))
    share = np.clip((a[..., 3] + b[..., 3]) / 2, 0, 1)
    bound = np.sqrt(share * (1 - share))
    compared.append(("alpha", a[..., 3], b[..., 3], bound, bound))
    each = significance / len(compared)
    outcomes = [
        compare_errors(x, x_error, y, y_error, common=common, significance=each, what=name)
        for name, x, y, x_error, y_error in compared
    ]
    found = [finding for outcome in outcomes for finding in outcome.findings]
    return replace(
        outcomes[0],
        p=min(1.0, len(outcomes) * min(outcome.p for outcome in outcomes)),
        significance=significance,
        findings=sorted(found, key=lambda finding: finding.score, reverse=True)[:3],
        same_bits=all(outcome.same_bits for outcome in outcomes),
        map=np.maximum.reduce([outcome.map for outcome in outcomes]),
    )


def _finite(x: npt.NDArray[np.floating]) -> Array:
    return np.nan_to_num(np.asarray(x, np.float64), posinf=0.0, neginf=0.0)


def compare_errors(
    reference: npt.NDArray[np.floating],
    reference_error: npt.NDArray[np.floating],
    picture: npt.NDArray[np.floating],
    picture_error: npt.NDArray[np.floating],
    *,
    common: bool,
    significance: float = SIGNIFICANCE,
    what: str = CHANNELS[0],
) -> Outcome:
    """Test values (rows, columns), of ``what``, by their standard errors; see the module.

    ``common``: whether the errors of all pixels may have a common part.
    """
    a, b = (np.asarray(x, np.float64) for x in (reference, picture))
    mean = float((a + b).mean() / 2)
    faint = FAINT * max(mean, 1e-30)
    difference = b - a
    variance = np.asarray(reference_error, np.float64) ** 2
    variance = variance + np.asarray(picture_error, np.float64) ** 2
    # Some of so many errors from few batches are far too small.
    around = local_median(variance[..., None])[..., 0]
    variance = np.maximum(variance, (variance + around) / 2)
    # Halves of EXR files are rounded.
    rounding = (2.0**-11 * (np.abs(a) + faint)) ** 2
    variance = variance + rounding
    ratio = float(b.mean() / a.mean()) if a.mean() > 0 else (1.0 if b.mean() == 0 else np.inf)
    significance_map = np.zeros(a.shape)
    findings: list[Finding] = []
    by_size: dict[int, float] = {}
    widening, levels = 1.0, int(np.ceil(np.log2(max(a.shape)))) + 1
    brightness, size = np.abs(a + b) / 2 + faint, 1
    while True:
        z = difference / np.sqrt(variance)
        if z.size >= FEWEST_CELLS:
            around = z if common else z - np.median(z)
            widening = max(widening, float(np.median(np.abs(around))) / MEDIAN)
        error = np.sqrt(variance) * widening
        if not (common and z.size < FEWEST_CELLS):
            t = z / widening
            scores = FREEDOM * np.log1p(t**2 / (2 * FREEDOM)) - np.log(z.size * levels)
            row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
            findings.append(
                Finding(
                    what,
                    size,
                    int(column) * size,
                    int(row) * size,
                    float(
                        difference[row, column]
                        / (1 if what == "alpha" else brightness[row, column])
                    ),
                    float(t[row, column]),
                    float(scores[row, column]),
                    False,
                )
            )
            spread = scores.repeat(size, axis=0).repeat(size, axis=1)[: a.shape[0], : a.shape[1]]
            significance_map = np.maximum(significance_map, spread / np.log(10))
            power = np.exp((np.log(z.size * levels) - np.log(significance)) / FREEDOM)
            limit = np.sqrt(2 * FREEDOM * (power - 1))
            by_size[size] = float(np.median((limit + 1.28) * error / brightness))
        if z.size == 1:
            break
        # Of independent pixels; what is not independent widens z.
        counts = halved(np.ones((1, *z.shape, 1)), sums=True)
        difference, brightness = (
            halved(x[None, ..., None])[0, ..., 0] for x in (difference, brightness)
        )
        summed = halved(variance[None, ..., None], sums=True)
        variance = (summed / counts**2)[0, ..., 0]
        size *= 2
    findings.sort(key=lambda finding: finding.score, reverse=True)
    p = float(min(1.0, np.exp(-findings[0].score)))
    return Outcome(
        p=p,
        tried=0,
        significance=significance,
        findings=findings[:3] if p <= significance else [],
        ratio=ratio,
        ratio_error=float(error.ravel()[0] / mean) if mean > 0 and not common else float("nan"),
        detectable=by_size[max(by_size)] if not common else float("inf"),
        detectable_by_size=by_size,
        same_bits=bool(np.array_equal(a, b)),
        map=significance_map,
    )
