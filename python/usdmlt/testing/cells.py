"""What tests of batches look at: cells of all sizes, in brightness and colours, and patterns.

A pyramid of cells, from single pixels, or blocks of few, to the whole picture, in luminance, red,
green, blue and alpha; and four patterns that mistakes make: brightness, gamma, and a shift to the
side or upwards. Noise is mostly of brightness, and small changes of colour would drown in it. So
red is what is left of it when the regression on green and blue, over the sums a_k + b_k, is taken
away; green and blue likewise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from usdmlt.color.spaces import LUMINANCE as LUMINANCE

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.floating]

FAINT = 1e-3  # of the picture's mean: the brightness of black, as far as the tolerance goes
CHANNELS = ("luminance", "red", "green", "blue", "alpha")
PATTERNS = ("brightness", "gamma", "shift x", "shift y")
# The least share of a colour's variance that the others do not explain. Without it, one firefly in
# each picture decides about the regression of their cell, which then calls their hues significant.
UNSHARED = 0.04
RIDGE = 0.005  # of that regression, likewise


@dataclass(frozen=True)
class Part:
    """The cells of one size, or the patterns; x is t / sum of signs, by batch and cell."""

    name: str
    size: int  # pixels across, 0 of patterns
    x: Array  # (batches, cells)
    error: Array  # (cells,), standard error of the mean difference
    brightness: Array  # (cells,), mean of both pictures, of luminance
    shape: tuple[int, ...]  # rows, columns, channels; of patterns (patterns,)
    clipped: bool
    freedom: float

    def scores(self, t: Array) -> Array:
        """Of |t| of a cell, corrected for the number of cells."""
        scores = self.freedom / 2 * np.log1p(t * t / self.freedom) - np.log(self.x.shape[1])
        return np.asarray(scores)

    def t(self, score: float) -> float:
        """|t| of a cell that has this score."""
        power = min(2 * (score + np.log(self.x.shape[1])) / self.freedom, 600.0)
        return float(np.sqrt(self.freedom * max(np.expm1(power), 0.0)))

    @property
    def observed(self) -> Array:
        """t by cell, with its sign."""
        return np.asarray(self.x.sum(axis=0))


def parts(a: Array, b: Array, cell: int, tolerance: float, clipped: bool = False) -> Iterator[Part]:
    """The pyramid's levels and the patterns."""
    faint = faint_of(a, b)
    finest = None
    size = cell
    while True:
        difference, variance, brightness = _moments(a, b, tolerance, faint)
        if finest is None:
            finest = difference[..., 0], (a + b)[..., :3] @ LUMINANCE, variance[..., 0]
        yield Part(
            f"{size} px",
            size,
            _normalised(difference, variance),
            np.sqrt(variance / len(a)).reshape(-1),
            np.broadcast_to(brightness, variance.shape).reshape(-1),
            variance.shape,
            clipped,
            2.0 * (len(a) - 1),
        )
        if a.shape[1] == a.shape[2] == 1:
            break
        a, b, size = halved(a), halved(b), 2 * size
    yield _patterns(*finest, cell, clipped)


def faint_of(a: Array, b: Array) -> float:
    """The luminance below which all is black."""
    return FAINT * max(float(np.mean((a + b)[..., :3] @ LUMINANCE)) / 2, 1e-30)


def _projection(total: Array) -> Array:
    """(rows, columns, 4, 5) from RGBA to CHANNELS, of the sums of both pictures (K, …, 4).

    Least squares of one colour on the others leaves sum_j P_ij x_j / P_ii, P the inverse of their
    covariance.
    """
    rgb = total[..., :3] - total[..., :3].mean(axis=0)
    spread = np.sqrt((rgb * rgb).sum(axis=0))
    spread[spread == 0] = 1
    rgb /= spread
    covariance = np.stack([(rgb * rgb[..., c : c + 1]).sum(axis=0) for c in range(3)], axis=-1)
    inverse = np.linalg.inv(local_mean(covariance) + RIDGE * np.eye(3))
    inverse /= np.diagonal(inverse, axis1=-2, axis2=-1)[..., None]
    out = np.zeros((*spread.shape[:2], 4, 5))
    out[..., :3, 0] = LUMINANCE
    out[..., :3, 1:4] = np.swapaxes(inverse * spread[..., :, None] / spread[..., None, :], -1, -2)
    out[..., 3, 4] = 1
    return out


def halved(x: Array, sums: bool = False) -> Array:
    """Means of 2x2 cells of (n, rows, columns, c); at the right and at the bottom of fewer.

    ``sums``: not means.
    """
    for axis in (1, 2):
        n = x.shape[axis]
        starts = np.arange(0, n, 2)
        counts = np.minimum(starts + 2, n) - starts
        shape = [1] * x.ndim
        shape[axis] = -1
        x = np.add.reduceat(x, starts, axis)
        if not sums:
            x = x / counts.reshape(shape)
    return x


def _moments(a: Array, b: Array, tolerance: float, faint: float) -> tuple[Array, ...]:
    """By cell and of CHANNELS: differences beyond the tolerance, their variance; brightness."""
    projection = _projection(a + b)
    total, difference = (np.einsum("kyxc,yxcd->kyxd", x, projection) for x in (a + b, b - a))
    mean = np.abs(a + b).mean(axis=0) / 2
    brightness = (mean[..., :3] @ LUMINANCE)[..., None] + faint
    # Of the mean, and of the batches' own values, which may be brighter.
    size = np.abs(projection)
    allowed = np.einsum("yxc,yxcd->yxd", mean, size)
    allowed[..., :4] += faint
    allowed[..., 4] = 1
    own = np.einsum("kyxc,yxcd->kyxd", (np.abs(a) + np.abs(b)) / 2, size)
    own[..., 4] = 0
    allowed *= tolerance
    own = tolerance * own + allowed
    difference -= np.clip(difference, -own, own)
    own = total.var(axis=0, ddof=1)
    own[..., 1:4] = np.maximum(own[..., 1:4], UNSHARED * (a + b)[..., :3].var(axis=0, ddof=1))
    variance = np.maximum(own, (own + local_median(own)) / 2) + allowed**2
    return difference, variance, brightness


def local_median(x: Array) -> Array:
    """Of 3x3 cells, of which those at the edges count more; of few cells none but their own."""
    return x if min(x.shape[:2]) < 3 else np.asarray(np.median(_around(x), axis=0))


def local_mean(x: Floats) -> Floats:
    """Of 3x3 cells, likewise."""
    if min(x.shape[:2]) < 3:
        return x
    for axis in (0, 1):
        y = np.swapaxes(x, 0, axis)
        total = y.copy()
        total[1:] += y[:-1]
        total[:-1] += y[1:]
        total[0] += y[0]
        total[-1] += y[-1]
        x = np.swapaxes(total, 0, axis)
    x /= 9
    return x


def _around(x: Array) -> list[Array]:
    padded = np.pad(x, [(1, 1), (1, 1)] + [(0, 0)] * (x.ndim - 2), mode="edge")
    rows, columns = x.shape[:2]
    return [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]


def _normalised(difference: Array, variance: Array) -> Array:
    x = difference / np.sqrt(len(difference) * variance)
    return x.reshape(len(x), -1)


def _patterns(difference: Array, total: Array, variance: Array, cell: int, clipped: bool) -> Part:
    """What mistakes make of the picture m: d = change * pattern, by weighted least squares.

    Of luminance (K, rows, columns). brightness: m; gamma: m log(m / mean m), its exponent less 1;
    shifts: -dm/dx and -dm/dy, per pixel, to the right and downwards.
    """
    count = len(difference)
    m, v = total.mean(axis=0) / 2, variance
    level = max(float(m.mean()), 1e-30)
    gradients = [np.gradient(m, axis=i) / cell if m.shape[i] > 1 else 0 * m for i in (1, 0)]
    # The noise around, not that of a cell: weight must not be less just where a firefly fell.
    weights = (local_median(v[..., None]) + (0.05 * local_median(m[..., None])) ** 2)[..., 0]
    weights = np.maximum(weights, 1e-6 * level**2)
    gamma = np.where(m > 0, m * np.log(np.maximum(m, 1e-30) / level), 0.0)
    x, errors = [], []
    for pattern in (m, gamma, -gradients[0], -gradients[1]):
        # Not all weight on pixels without noise, such as lights that are seen directly.
        weight = pattern / weights
        weight /= float((weight * pattern).sum()) or 1.0
        change, both = (np.tensordot(y, weight, 2) for y in (difference, total))
        error = max(float(both.std(ddof=1)), 1e-9) / np.sqrt(count)
        x.append(change / (count * error))
        errors.append(error)
    n = len(x)
    freedom = float(count - 1)
    return Part("patterns", 0, np.array(x).T, np.array(errors), np.ones(n), (n,), clipped, freedom)


def without_outliers(a: Array, b: Array) -> tuple[Array, Array]:
    """With outliers of luminance among the 2K values of a cell scaled down, hue kept."""
    luminance = [x[..., :3] @ LUMINANCE for x in (a, b)]
    middle, high = np.quantile(np.concatenate(luminance), [0.5, 0.85], axis=0)
    limit = (middle + 4 * (high - middle))[..., None]
    limit = np.maximum(limit, local_median(limit))[..., 0]
    out = []
    for x, y in zip((a, b), luminance, strict=True):
        factor = np.where(y > limit, limit / np.maximum(y, 1e-300), 1.0)
        out.append(np.concatenate([x[..., :3] * factor[..., None], x[..., 3:]], axis=-1))
    return out[0], out[1]
