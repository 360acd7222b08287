"""What a test found: how likely, where, how much, and what it would have seen."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from usdmlt.testing.cells import CHANNELS, PATTERNS, Array, Part

POWER = 1.28  # standard normal quantile of 0.9


@dataclass(frozen=True)
class Evidence:
    """What a test says of the parts it looked at: p, told from so many resamplings.

    ``limit``: the score of noise with the asked probability; ``least``: t that is above it anyway;
    ``margin``: by how much more t has to be where other noise would have had another limit.
    """

    p: float
    tried: int
    parts: list[Part]
    limit: float
    least: float = 0.0
    margin: float = 1.0


@dataclass(frozen=True)
class Finding:
    """Where two pictures differ most: a cell, its channel and how."""

    what: str  # a channel, or a pattern
    size: int  # pixels across; 0 of a pattern of the whole picture
    x: int  # of the upper left pixel
    y: int
    change: float  # relative to the brightness there; of alpha, gamma and shifts their amount
    t: float
    score: float
    clipped: bool

    def __str__(self) -> str:
        if self.size == 0:
            amount = f"{self.change:+.2f} px" if "shift" in self.what else f"{self.change:+.2%}"
            return f"{self.what} {amount} (t = {self.t:.1f})"
        amount = f"{self.change:+.3f}" if self.what == "alpha" else f"{self.change:+.2%}"
        of = "" if self.what == "alpha" else " of the brightness"
        return (
            f"{self.what} {amount}{of} in the {self.size}x{self.size} "
            f"pixels at ({self.x}, {self.y}) (t = {self.t:.1f})"
        )


@dataclass(frozen=True)
class Outcome:
    """What a test of two sets of batches found.

    ``p``: probability of such a difference, or a larger one, where there is none; over all cells;
    told from so many resamplings, ``tried``.
    ``ratio``: mean luminance of the second picture over that of the first, ``ratio_error`` its
    standard error. ``detectable``: the smallest relative change of the whole picture's brightness
    that would be found, nine times out of ten; ``detectable_by_size``: of one cell of that many
    pixels across, in the median.
    ``map``: (rows, columns) of the finest cells: -log10 of p of the worst cell around, corrected.
    """

    p: float
    tried: int
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


def detectable(evidence: Evidence) -> tuple[dict[int, float], float]:
    """Smallest relative changes of luminance: by size of cells, and of the whole picture.

    t of a change of true size T is T + z, times sigma/s, and T is told in units of another s: to
    find it nine times out of ten, T has to be above the limit by 1.28 sqrt(1 + T^2/nu).
    """
    by_size: dict[int, float] = {}
    whole = np.inf
    for part in evidence.parts:
        t = max(part.t(evidence.limit), evidence.least) * evidence.margin
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


def findings(evidence: Evidence, most: int = 5) -> list[Finding]:
    """The cells beyond the limit, or else the highest: those that lie apart, highest first."""
    found: list[Finding] = []
    for part in evidence.parts:
        t = part.observed
        scores = part.scores(np.abs(t))
        for i in np.argsort(scores)[::-1][:most]:
            change = float(t[i] * part.error[i])
            if part.size == 0:
                what, x, y = PATTERNS[i], 0, 0
            else:
                row, column, channel = np.unravel_index(i, part.shape)
                what, x, y = CHANNELS[channel], int(column) * part.size, int(row) * part.size
                change /= 1 if what == "alpha" else float(part.brightness[i])
            found.append(
                Finding(what, part.size, x, y, change, float(t[i]), float(scores[i]), part.clipped)
            )
    found.sort(key=lambda finding: finding.score, reverse=True)
    chosen: list[Finding] = []
    for finding in found:
        if len(chosen) == most or (chosen and finding.score < evidence.limit):
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


def map_of(evidence: Evidence, shape: tuple[int, int], cell: int) -> Array:
    """-log10 of the corrected p of the worst cell at each place, of any channel.

    Of cells up to an eighth of the picture: larger ones do not say where.
    """
    out = np.zeros(shape)
    for part in evidence.parts:
        repeat = part.size // cell
        if part.size == 0 or repeat > max(max(shape) // 8, 1):
            continue
        scores = part.scores(np.abs(part.observed)).reshape(part.shape).max(axis=-1)
        spread = scores.repeat(repeat, axis=0).repeat(repeat, axis=1)
        out = np.maximum(out, spread[: shape[0], : shape[1]] / np.log(10))
    return out
