"""Statistical comparison of pictures that were rendered several times with independent seeds.

The standard errors come from the spread between seeds, so correlation within a picture does no
harm. Three questions are asked of a pair of sets (or of a set and a known picture):

* pixels: does any pixel differ? The smallest p-value of t-tests, after Šidák's correction for
  their number m: p = 1 − (1 − p_min)^m.
* blocks: the same of the means over blocks of pixels, which sees faint large structure.
* mean: does the mean of the picture differ?

With few seeds t-tests have heavy tails; Student's distribution (Welch's degrees of freedom for
pairs) accounts for that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats


@dataclass
class Agreement:
    """p-values of the three questions, and how sharp the answer is.

    ``difference``: relative difference of the means; ``resolution``: its standard error, so a bias
    of the mean of some four times that would have been seen. ``block_resolution``: the same of one
    block, in the median.
    """

    pixels: float
    blocks: float
    mean: float
    difference: float
    resolution: float
    block_resolution: float
    worst: tuple[int, ...]

    def require(
        self,
        significance: float = 1e-3,
        resolution: float = 0.02,
        block_resolution: float = math.inf,
        questions: tuple[str, ...] = ("pixels", "blocks", "mean"),
    ) -> Agreement:
        """Fail where a question is answered "different", or where the noise hides the answer."""
        assert self.resolution <= resolution, f"too noisy to tell: {self}"
        assert self.block_resolution <= block_resolution, f"blocks too noisy to tell: {self}"
        for question in questions:
            assert getattr(self, question) >= significance, f"{question} differ: {self}"
        return self


def sidak(p: np.ndarray) -> float:
    """p-value of the smallest of m independent p-values."""
    smallest = np.nanmin(p)
    return float(-np.expm1(p.size * np.log1p(-smallest))) if smallest < 1 else 1.0


def _p_values(a: np.ndarray, b: np.ndarray, lumpy: bool = False) -> np.ndarray:
    """Two-sided p-values of equal means of a, b (n, …); b of one entry is known exactly.

    What does not vary at all has to agree to rounding.
    """
    larger = np.maximum(a.mean(axis=0), b.mean(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        variances = [x.var(axis=0, ddof=1) / len(x) if len(x) > 1 else 0.0 for x in (a, b)]
        if lumpy:
            variances = [np.maximum(v, np.nanmedian(v / larger) * larger) for v in variances]
        variance = variances[0] + variances[1]
        freedom = variance**2 / sum(
            v**2 / (len(x) - 1) for v, x in zip(variances, (a, b), strict=True) if len(x) > 1
        )
        difference = a.mean(axis=0) - b.mean(axis=0)
        size = np.maximum(np.abs(a.mean(axis=0)), np.abs(b.mean(axis=0)))
        # Pictures are float32.
        rounding = np.maximum(1e-6 * size, 1e-30)
        t = np.abs(difference) / np.sqrt(variance + rounding**2)
        p = 2 * stats.t.sf(t, np.maximum(freedom, 1.0))
    still = np.asarray(variance) <= rounding**2
    return np.where(still, np.where(np.abs(difference) <= 10 * rounding, 1.0, 0.0), p)


def blocks_of(pictures: np.ndarray, size: int) -> np.ndarray:
    """Means over blocks of size × size pixels of (n, h, w, c); incomplete blocks are left out."""
    n, h, w, c = pictures.shape
    cut = pictures[:, : h // size * size, : w // size * size]
    return cut.reshape(n, h // size, size, w // size, size, c).mean(axis=(2, 4))


def _relative_error(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Standard error of the difference of the means over the first axis, relative to b's."""
    variance = sum(x.var(axis=0, ddof=1) / len(x) for x in (a, b) if len(x) > 1)
    mean = np.abs(b.mean(axis=0))
    return np.sqrt(variance)[mean > 0] / mean[mean > 0]


def agreement(a: np.ndarray, b: np.ndarray, block: int = 4, lumpy: bool = False) -> Agreement:
    """Compare pictures (seeds, h, w, c) with others, or with one exact picture (h, w, c).

    ``lumpy``: pictures by chains, whose light comes in lumps of similar size. The variance of a
    pixel is then in proportion to its mean, and where few lumps fell, too few to show in the
    spread, that proportion (the median over pixels) stands in for it.
    """
    b = b[None] if b.ndim == 3 else b
    p = _p_values(a, b, lumpy)
    means = [x.mean(axis=(1, 2, 3)) for x in (a, b)]
    blocks = [blocks_of(x, block) for x in (a, b)]
    reference = abs(float(means[1].mean()))
    return Agreement(
        pixels=sidak(p),
        blocks=sidak(_p_values(*blocks, lumpy)),
        mean=float(_p_values(means[0][:, None], means[1][:, None])[0]),
        difference=float(means[0].mean() - means[1].mean()) / reference,
        resolution=float(_relative_error(*(m[:, None] for m in means))[0]),
        block_resolution=float(np.median(_relative_error(*blocks))),
        worst=tuple(int(i) for i in np.unravel_index(np.argmin(p), p.shape)),
    )


def standard_errors(values: np.ndarray, expected: float | np.ndarray) -> np.ndarray:
    """(mean − expected) in standard errors of the mean over the first axis, rounding included."""
    error = np.hypot(values.std(axis=0, ddof=1) / np.sqrt(len(values)), 1e-6 * np.abs(expected))
    return (values.mean(axis=0) - expected) / error
