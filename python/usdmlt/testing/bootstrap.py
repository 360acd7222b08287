"""How likely a difference is between pictures made in different ways.

Noise of one integrator may be even where that of another is a few fireflies, so batches cannot
change places. Their means can still be compared. Of the differences d_k = b_k - a_k of a cell,

    t = mean d / sqrt(v / K),    v = (s^2 + mean of s^2 around) / 2 + tolerance^2,

s^2 their variance, around being 3x3 cells, or all where there are fewer. t is far from normal
where noise is skewed: if fireflies carry light, most cells lack some, and show little noise
besides. How far is seen when batches are drawn anew from those that there are, with replacement,
and t* is that of such a picture against the mean of all (the bootstrap-t; Efron & Tibshirani 1993,
An Introduction to the Bootstrap, 12.5): a cell with one firefly is without it in every third draw.
The largest |t*| over all cells of a size, draw by draw, says which |t| is rare at this size; the
smallest of these p-values, times the number of sizes, is p (Westfall & Young 1993; Bonferroni).

Few cells can happen to have few of the fireflies that there are, and their draws then know too
little of them. So the tail of a size, where draws are too few to tell, is no shorter than that of
half the size, of which there are more cells, of noise that is more skewed.

So p is no exact probability, but close to it, mostly above, as long as either picture has met all
there is, somewhere: what none of its batches found anywhere counts as missing. The price is that
fireflies, which a comparison of like pictures cuts, hide small differences of cells of their size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from usdmlt.testing.cells import LUMINANCE, Array, Floats, Part, faint_of, halved, local_mean
from usdmlt.testing.outcome import Evidence

DRAWS = 1024
CHUNK = 1 << 18  # values of cells and draws at a time
RANKED = 32  # draws beyond t from which their share is p; of fewer the tail is continued
TAIL = 48  # largest draws that say how it goes on
MARGIN = 1.4  # nine in ten limits of t are within that of their median
# Of RGBA, CHANNELS: here each colour less the mean of the other two.
OPPONENT = np.zeros((4, 5))
OPPONENT[:3, 0] = LUMINANCE
OPPONENT[:3, 1:4] = 1.5 * np.eye(3) - 0.5
OPPONENT[3, 4] = 1


@dataclass(frozen=True)
class Tail:
    """The distribution of the largest score of a size, from draws in rising order.

    Beyond ``start`` it is a generalised Pareto distribution (Pickands 1975; Knijnenburg et al.
    2009, Fewer permutations, more accurate P-values), by moments (Hosking & Wallis 1987), with a
    tail no lighter than exponential; ``excess`` is its mean.
    """

    drawn: Array
    start: float
    shape: float
    excess: float

    @classmethod
    def of(cls, scores: Array) -> Tail:
        """From draws in any order."""
        drawn = np.sort(scores)
        start = float(drawn[-TAIL - 1])
        beyond = drawn[-TAIL:] - start
        mean, variance = float(beyond.mean()), float(beyond.var(ddof=1))
        shape = max((1 - mean * mean / variance) / 2, 0.0) if variance > 0 else 0.0
        return cls(drawn, start, shape, max(mean, 1e-9))

    @property
    def scale(self) -> float:
        return self.excess * (1 - self.shape)

    def minus_log_p(self, score: Array) -> Array:
        """-log of the probability of this score or a higher one."""
        count = len(self.drawn)
        beyond = count - np.searchsorted(self.drawn, score)
        ranked = np.log((count + 1) / (beyond + 1))
        x = np.maximum(score - self.start, 0) / self.scale
        tail = np.log1p(self.shape * x) / self.shape if self.shape > 1e-6 else x
        return np.where(beyond >= RANKED, ranked, tail + np.log(count / TAIL))

    def score(self, minus_log_p: float) -> float:
        """The inverse."""
        count = len(self.drawn)
        beyond = (count + 1) * np.exp(-minus_log_p) - 1
        if beyond >= RANKED:
            return float(self.drawn[count - int(beyond)])
        x = max(minus_log_p - np.log(count / TAIL), 0.0)
        x = np.expm1(min(self.shape * x, 600.0)) / self.shape if self.shape > 1e-6 else x
        return self.start + self.scale * float(x)


@dataclass(frozen=True)
class Drawn(Part):
    """Cells of one size whose scores are -log of p of the size."""

    tail: Tail

    def scores(self, t: Array) -> Array:
        """Of |t| of a cell."""
        return self.tail.minus_log_p(_score(t, self.freedom))

    def t(self, score: float) -> float:
        """|t| of a cell that has this score."""
        power = min(2 * self.tail.score(score) / self.freedom, 600.0)
        return float(np.sqrt(self.freedom * max(np.expm1(power), 0.0)))


def weigh(a: Array, b: Array, cell: int, significance: float, tolerance: float) -> Evidence:
    """Draw the batches of a and b anew."""
    rng = np.random.default_rng(len(a))
    draws = rng.multinomial(len(a), np.full(len(a), 1 / len(a)), size=DRAWS) / len(a)
    parts: list[Part] = list(_parts(a, b, cell, tolerance, draws))
    scores = [float(part.scores(np.abs(part.observed)).max()) for part in parts]
    p = min(len(parts) * float(np.exp(-max(scores))), 1.0)
    return Evidence(p, DRAWS, parts, float(np.log(len(parts) / significance)), margin=MARGIN)


def _parts(a: Array, b: Array, cell: int, tolerance: float, draws: Array) -> Iterator[Drawn]:
    faint, size, freedom = faint_of(a, b), cell, float(len(a) - 1)
    finer = 0.0
    while True:
        difference, allowed, brightness = _differences(a, b, tolerance, faint)
        centred = difference - difference.mean(axis=0)
        variance = _variance((centred**2).mean(axis=0), 0 * allowed, len(a)) + allowed**2
        variance = np.maximum(variance, 1e-300)
        tail = Tail.of(_score(_largest(centred, allowed, draws), freedom))
        yield Drawn(
            f"{size} px",
            size,
            (difference / np.sqrt(len(a) * variance)).reshape(len(a), -1),
            np.sqrt(variance / len(a)).reshape(-1),
            np.broadcast_to(brightness[..., None], variance.shape).reshape(-1),
            variance.shape,
            False,
            freedom,
            replace(tail, excess=max(tail.excess, finer)),
        )
        finer = tail.excess
        if a.shape[1] == a.shape[2] == 1:
            break
        a, b, size = halved(a), halved(b), 2 * size


def _differences(a: Array, b: Array, tolerance: float, faint: float) -> tuple[Array, Array, Array]:
    """By cell and of CHANNELS: those beyond the tolerance, by batch; the tolerance; brightness."""
    mean = np.abs(a + b).mean(axis=0) / 2
    allowed = mean @ np.abs(OPPONENT)
    allowed[..., :4] += faint
    allowed[..., 4] = 1
    allowed *= tolerance
    difference = (b - a) @ OPPONENT
    difference -= np.clip(difference, -allowed, allowed)
    return difference, allowed, mean[..., :3] @ LUMINANCE + faint


def _variance(square: Floats, mean: Floats, batches: int) -> Floats:
    """v but for the tolerance: of rows and columns and whatever else; ``square`` is lost."""
    square -= mean * mean
    square *= batches / (batches - 1)
    square += local_mean(square) if min(square.shape[:2]) >= 3 else square.mean(axis=(0, 1))
    square /= 2
    return square


def _largest(centred: Array, allowed: Array, draws: Array) -> Array:
    """The largest |t*| of all cells, by draw; ``draws``: how often a batch is in it, over K."""
    batches, *shape = centred.shape
    scale = float(np.abs(centred).max()) or 1.0
    x = np.ascontiguousarray((centred / scale).reshape(batches, -1).T, np.float32)
    floor = np.maximum((allowed / scale)[..., None] ** 2, 1e-30).astype(np.float32)
    square = x * x
    out = []
    for i in range(0, len(draws), step := max(CHUNK // len(x), 8)):
        chosen = np.ascontiguousarray(draws[i : i + step].T, np.float32)
        mean = (x @ chosen).reshape(*shape, -1)
        variance = _variance((square @ chosen).reshape(*shape, -1), mean, batches)
        variance += floor
        mean *= mean
        mean /= variance
        out.append(np.sqrt(batches * mean.reshape(len(x), -1).max(axis=0)))
    return np.concatenate(out).astype(np.float64)


def _score(t: Array, freedom: float) -> Array:
    """About -log of a p-value of |t|."""
    return np.asarray(freedom / 2 * np.log1p(t * t / freedom))
