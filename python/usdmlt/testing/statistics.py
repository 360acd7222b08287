"""Do two sets of independent batches show the same picture?

Pixels of a render are correlated, by pixel filters, by chains, by one normalisation of all, so no
formula says how its errors add up. Batches do: K pictures of the same thing by independent random
numbers, a_1 … a_K of the reference and b_1 … b_K of the picture that is checked. If nothing but
those numbers differs, then a_k and b_k may change places in any of the pairs and every such set is
as likely as the one that was seen. Of a statistic of the pairs' differences d_k = b_k - a_k,

    p = share of the 2^(K-1) sets of signs e for which S(e d) >= S(d)

is therefore the exact probability of a false alarm, for any distribution of the noise, whatever is
correlated, and for the largest of any number of cells (R. A. Fisher 1935; Westfall & Young 1993).
All sets of signs are too many, so a fixed random choice of
65 535 stands beside the one that was seen, which keeps p exact: its smallest value is 1.5e-5. K is
large enough for that value to be reached by changes that some of the batches miss.

S is the largest of many scores: of every cell of a pyramid, from blocks of few pixels to the whole
picture, in luminance, red, green, blue and alpha; and of four patterns that mistakes make:
brightness, gamma, and a shift to the side or upwards. Noise is mostly of brightness, and small
changes of colour would drown in it. So red is what is left of it when the regression on green and
blue, over the sums a_k + b_k, is taken away; green and blue likewise. A cell's

    t = sum_k e_k d_k / sqrt(K s^2),    score = nu/2 log(1 + t^2/nu) - log(cells of its level),

about -log of a p-value corrected for their number, which makes levels comparable. s^2 is the
variance of the sums a_k + b_k. It is the same for all signs, and a difference of the two pictures
is not in it; small ones are drawn to those of the cells around.

Fireflies enlarge s, so a cell with one says little. All is therefore done twice, the second time
with bright outliers among the 2K values of a block cut. Neither way knows which picture a value
is from, so p stays exact. But what is cut depends on how noise is distributed, and so does what a
regression leaves. Where that may differ although the pictures' means do not (other integrators,
sample counts or versions), ``alike=False`` leaves the second part out and compares each colour with
the mean of the other two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from usdmlt.errors import UsageError

Array = npt.NDArray[np.float64]

BATCHES = 24
SIGNIFICANCE = 1e-4
# Differences of a cell below this share of its brightness do not count: other compilers and
# instruction sets make such.
TOLERANCE = 1e-4
FAINT = 1e-3  # of the picture's mean: the brightness of black, as far as the tolerance goes
MOST_SIGNS = 1 << 16
ENOUGH = 64  # sets of signs that reach S, after which p is told from those that were tried
CHANNELS = ("luminance", "red", "green", "blue", "alpha")
PATTERNS = ("brightness", "gamma", "shift x", "shift y")
POWER = 1.28  # standard normal quantile of 0.9
# The least share of a colour's variance that the others do not explain. Without it, one firefly in
# each picture decides about the regression of their cell, which then calls their hues significant.
UNSHARED = 0.04
RIDGE = 0.005  # of that regression, likewise
# Products of matrices that OpenBLAS leaves to one thread: by more, these small ones take longer.
PRODUCTS = 1 << 18
ROWS = 32


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


@dataclass(frozen=True)
class Finding:
    """Where two pictures differ most: a cell, its channel and how."""

    what: str  # a channel, or a pattern
    size: int  # pixels across; 0 of a pattern of the whole picture
    x: int  # of the upper left pixel
    y: int
    change: float  # relative to the brightness there; of gamma and shifts their amount
    t: float
    score: float
    clipped: bool

    def __str__(self) -> str:
        if self.size == 0:
            amount = f"{self.change:+.2f} px" if "shift" in self.what else f"{self.change:+.2%}"
            return f"{self.what} {amount} (t = {self.t:.1f})"
        return (
            f"{self.what} {self.change:+.2%} of the brightness in the {self.size}x{self.size} "
            f"pixels at ({self.x}, {self.y}) (t = {self.t:.1f})"
        )


@dataclass(frozen=True)
class Outcome:
    """What a test of two sets of batches found.

    ``p``: probability of such a difference, or a larger one, where there is none; over all cells.
    ``ratio``: mean luminance of the second picture over that of the first, ``ratio_error`` its
    standard error. ``detectable``: the smallest relative change of the whole picture's brightness
    that would be found, nine times out of ten; ``detectable_by_size``: of one cell of that many
    pixels across, in the median.
    ``map``: (rows, columns) of the finest cells: -log10 of p of the worst cell around, corrected.
    """

    p: float
    signs: int
    significance: float
    findings: list[Finding]
    ratio: float
    ratio_error: float
    detectable: float
    detectable_by_size: dict[int, float]
    same_bits: bool = False
    map: Array = field(default_factory=lambda: np.zeros((1, 1)), repr=False)

    @property
    def different(self) -> bool:
        """Whether the pictures differ, at the stated significance."""
        return self.p <= self.significance


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
    ``alike``: whether noise is distributed in one way in both; else only means are compared.
    ValueError where ``significance`` is less than so few batches can show.
    """
    a, b = (np.asarray(x, dtype=np.float64) for x in (reference, picture))
    if a.shape != b.shape or a.ndim != 4:
        raise UsageError(f"batches of the shapes {a.shape} and {b.shape} cannot be compared")
    if 2.0 ** (1 - len(a)) > significance:
        raise UsageError(
            f"{len(a)} batches cannot show a significance of {significance:g}: "
            f"{int(np.ceil(np.log2(1 / significance))) + 1} are needed"
        )
    total = np.array([x[..., :3].mean(axis=(1, 2)) @ LUMINANCE for x in (a, b)])
    ratio, ratio_error = _ratio(total)
    parts = list(_parts(a, b, cell, tolerance, clipped=False, alike=alike))
    if alike:
        parts += _parts(*_clipped(a, b), cell, tolerance, clipped=True)
    rows, columns = a.shape[1:3]
    if np.array_equal(a, b):
        score, p, signs = -np.inf, 1.0, 0
    else:
        score = float(_largest([(part, part.x) for part in parts], np.ones((1, len(a))))[0])
        p, signs = _p_value(parts, score, len(a))
    limit = _score_at(parts, significance, len(a))
    by_size, whole = _detectable(parts, limit, _least_t(significance, len(a)))
    return Outcome(
        p=p,
        signs=signs,
        significance=significance,
        findings=_findings(parts, limit) if p <= significance else [],
        ratio=ratio,
        ratio_error=ratio_error,
        detectable=whole,
        detectable_by_size=by_size,
        same_bits=bool(np.array_equal(a, b)),
        map=_map(parts, (rows, columns), cell),
    )


# ---------------------------------------------------------------------------------------------
# Cells

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# Of RGBA, CHANNELS where colours are not regressed: each less the mean of the other two.
OPPONENT = np.zeros((4, 5))
OPPONENT[:3, 0] = LUMINANCE
OPPONENT[:3, 1:4] = 1.5 * np.eye(3) - 0.5
OPPONENT[3, 4] = 1


def _parts(
    a: Array, b: Array, cell: int, tolerance: float, clipped: bool, alike: bool = True
) -> Iterator[Part]:
    """The pyramid's levels and the patterns."""
    faint = FAINT * max(float(np.mean((a + b)[..., :3] @ LUMINANCE)) / 2, 1e-30)
    finest = None
    size = cell
    while True:
        difference, variance, brightness = _moments(a, b, tolerance, faint, alike)
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


def _moments(a: Array, b: Array, tolerance: float, faint: float, alike: bool) -> tuple[Array, ...]:
    """By cell and of CHANNELS: differences beyond the tolerance, their variance; brightness."""
    projection = _projection(a + b) if alike else np.tile(OPPONENT, (*a.shape[1:3], 1, 1))
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


def local_mean(x: Array) -> Array:
    """Of 3x3 cells, likewise."""
    return x if min(x.shape[:2]) < 3 else np.asarray(np.mean(_around(x), axis=0))


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


def _clipped(a: Array, b: Array) -> tuple[Array, Array]:
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


def _ratio(totals: Array) -> tuple[float, float]:
    """Ratio of the second mean to the first, and its standard error (delta method)."""
    means = totals.mean(axis=1)
    if not means[0] > 0:
        return (1.0 if means[1] == 0 else float("inf")), 0.0
    ratio = means[1] / means[0]
    rest = totals[1] - ratio * totals[0]
    return float(ratio), float(rest.std(ddof=1) / np.sqrt(len(rest)) / means[0])


# ---------------------------------------------------------------------------------------------
# Signs


def _signs(batches: int) -> Iterator[Array]:
    """Sets of signs, the first all +1, then the others in a fixed random order, by chunks.

    The first sign is always +1: turning all of them changes nothing. All sets where they are few.
    """
    rng = np.random.default_rng(batches)
    count = 2 ** (batches - 1)
    if count <= MOST_SIGNS:
        numbers = rng.permutation(np.arange(1, count))
    else:
        numbers = rng.integers(1, count, MOST_SIGNS - 1)
    yield np.ones((1, batches))
    start, size = 0, 128
    bits = np.arange(batches)
    while start < len(numbers):
        chunk = numbers[start : start + size]
        yield np.where((chunk[:, None] >> bits[::-1]) & 1, -1.0, 1.0)
        start, size = start + size, min(2 * size, 2048)


def _largest(cells: list[tuple[Part, Array]], signs: Array) -> Array:
    """S by set of signs, of some cells of each part."""
    scores = np.full(len(signs), -np.inf)
    columns = max(PRODUCTS // (ROWS * signs.shape[1]), 1)
    for part, x in cells:
        largest = np.zeros(len(signs))
        for i in range(0, x.shape[1], columns):
            block = np.ascontiguousarray(x[:, i : i + columns])
            for j in range(0, len(signs), ROWS):
                t = signs[j : j + ROWS] @ block
                np.maximum(largest[j : j + ROWS], t.max(axis=1), out=largest[j : j + ROWS])
                np.maximum(largest[j : j + ROWS], -t.min(axis=1), out=largest[j : j + ROWS])
        if x.shape[1]:
            scores = np.maximum(scores, part.scores(largest))
    return scores


def _p_value(parts: list[Part], score: float, batches: int) -> tuple[float, int]:
    """Share of the sets of signs that reach the score, and how many were tried.

    Cells that cannot reach it under any signs need not be looked at.
    """
    able = []
    for part in parts:
        reach = np.abs(part.x).sum(axis=0)
        able.append((part, part.x[:, reach >= part.t(score) * (1 - 1e-9)]))
    reached = tried = 0
    for signs in _signs(batches):
        scores = _largest(able, signs)
        reached += int(np.count_nonzero(scores >= score - 1e-9 * max(abs(score), 1.0)))
        tried += len(signs)
        if reached > ENOUGH:
            break
    return reached / tried, tried


# ---------------------------------------------------------------------------------------------
# What is reported


def _score_at(parts: list[Part], significance: float, batches: int, tried: int = 384) -> float:
    """The score that noise reaches with this probability, about.

    From the highest hundredth of some sets of signs; beyond, scores fall by one when p does by e.
    """
    chunks, count = [], 0
    cells = [(part, part.x) for part in parts]
    for signs in _signs(batches):
        if count:  # the first is what was seen
            chunks.append(_largest(cells, signs))
        count += len(signs)
        if count > tried:
            break
    highest = float(np.quantile(np.concatenate(chunks), 0.99))
    return highest + float(np.log(0.01 / significance))


def _least_t(significance: float, batches: int) -> float:
    """t below which so few pairs cannot be significant: that of the same number without noise.

    Of random signs e, sum e d / sqrt(sum d^2) is about normal.
    """
    normal = NormalDist().inv_cdf(1 - significance / 2)
    return float(normal * np.sqrt((batches - 1) / max(batches - normal**2, 0.5)))


def _detectable(parts: list[Part], limit: float, least: float) -> tuple[dict[int, float], float]:
    """Smallest relative changes of luminance: by size of cells, and of the whole picture.

    t of a change of true size T is T + z, times sigma/s, and T is told in units of another s: to
    find it nine times out of ten, T has to be above the limit by 1.28 sqrt(1 + T^2/nu).
    """
    by_size: dict[int, float] = {}
    whole = np.inf
    for part in parts:
        t = max(part.t(limit), least)
        t += POWER * math.sqrt(1 + t * t / part.freedom)
        if part.size:
            relative = (part.error / part.brightness).reshape(part.shape)[..., 0]
            change = float(np.median(t * relative))
            by_size[part.size] = min(by_size.get(part.size, np.inf), change)
            if part.shape[:2] == (1, 1):
                whole = min(whole, change)
        else:
            whole = min(whole, t * float(part.error[PATTERNS.index("brightness")]))
    return by_size, whole


def _findings(parts: list[Part], limit: float, most: int = 5) -> list[Finding]:
    """The cells beyond the limit, or else the highest: those that lie apart, highest first."""
    found: list[Finding] = []
    for part in parts:
        t = part.observed
        scores = part.scores(np.abs(t))
        for i in np.argsort(scores)[::-1][:most]:
            change = float(t[i] * part.error[i] / part.brightness[i])
            if part.size == 0:
                what, x, y = PATTERNS[i], 0, 0
            else:
                row, column, channel = np.unravel_index(i, part.shape)
                what, x, y = CHANNELS[channel], int(column) * part.size, int(row) * part.size
            found.append(
                Finding(what, part.size, x, y, change, float(t[i]), float(scores[i]), part.clipped)
            )
    found.sort(key=lambda finding: finding.score, reverse=True)
    chosen: list[Finding] = []
    for finding in found:
        if len(chosen) == most or (chosen and finding.score < limit):
            break
        if not any(_same_place(finding, other) for other in chosen):
            chosen.append(finding)
    return chosen


def _same_place(one: Finding, other: Finding) -> bool:
    if (one.size == 0) != (other.size == 0):
        return False
    if one.size == 0:
        return one.what == other.what
    return (
        one.x < other.x + other.size
        and other.x < one.x + one.size
        and one.y < other.y + other.size
        and other.y < one.y + one.size
    )


def _map(parts: list[Part], shape: tuple[int, int], cell: int) -> Array:
    """-log10 of the corrected p of the worst cell at each place, of any channel.

    Of cells up to an eighth of the picture: larger ones do not say where.
    """
    out = np.zeros(shape)
    for part in parts:
        repeat = part.size // cell
        if part.size == 0 or repeat > max(max(shape) // 8, 1):
            continue
        scores = part.scores(np.abs(part.observed)).reshape(part.shape).max(axis=-1)
        spread = scores.repeat(repeat, axis=0).repeat(repeat, axis=1)
        out = np.maximum(out, spread[: shape[0], : shape[1]] / np.log(10))
    return out
