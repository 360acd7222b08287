"""Errors of the integrators in the same processor time, against references.

    relMSE = mean((I - A)(I - B) / (R^2 + 0.01)),

I, A, B and R scaled to mean 1. A and B are independent halves of the reference, so that their own
noise has mean 0 in it; R, in the denominator, is a third run. The same of the means of blocks of
16x16 pixels sees noise that comes in clumps, and the spread of the unscaled means over seeds a bad
normalisation. Where a few fireflies make most of the error, that of all pixels but the worst
thousandth says what the rest is like. Errors of all of them come from independent seeds.

The reference is made by bidirectional path tracing. Where that is dominated by fireflies, or so
noisy that R means nothing, it is none, and chains with other seeds make it ("mlt"). Either way
every integrator's row says how far its mean and its blocks are from those of the reference, in
their standard errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from usdmlt.errors import Error
from usdmlt.rendering import Rendering, no_warnings
from usdmlt.settings import UNLIMITED_SAMPLES, IntegratorName, Settings

if TYPE_CHECKING:
    from usdmlt.scene import Scene

Picture = npt.NDArray[np.float64]

BLOCK = 16  # pixels
FIRST_SEEDS = {"calibration": 1 << 20, "reference": 1 << 21}  # those that are measured begin at 0
BATCHES = 12  # of a reference: four each for A, B and R
REFERENCES: tuple[IntegratorName, ...] = ("bdpt", "mlt")
# Fireflies dominate where this share of the values makes more than half of the squared error.
FIREFLY_SHARE = 0.001
WORST = 0.001  # of the pixels, that the trimmed error leaves out


@dataclass(frozen=True)
class Timed:
    """A finished render."""

    picture: Picture  # (height, width, 3)
    seconds: float  # of processor time, from the scene description to the last unit
    integrator: str
    stats: dict[str, Any]


@dataclass(frozen=True)
class Reference:
    """Independent batches of a long render."""

    integrator: str
    batches: list[Picture]
    seconds: float

    @property
    def parts(self) -> tuple[Picture, Picture, Picture]:
        """A, B and R."""
        a, b, r = (np.mean(self.batches[i::3], axis=0) for i in range(3))
        return a, b, r

    @property
    def rel_mse(self) -> float:
        """Of A, or of B."""
        return float(np.mean(self._squared_errors()))

    @property
    def fireflies(self) -> float:
        """The share of the squared error that the worst thousandth of the values makes."""
        errors = np.sort(self._squared_errors(), axis=None)[::-1]
        worst = errors[: max(1, round(FIREFLY_SHARE * errors.size))]
        return float(worst.sum() / (errors.sum() or 1.0))

    def _squared_errors(self) -> Picture:
        a, b, r = (_scaled(p) for p in self.parts)
        errors: Picture = (a - b) ** 2 / 2 / (r**2 + 0.01)
        return errors


@dataclass(frozen=True)
class Row:
    """What an integrator reaches; ``_error``: the standard error, from the seeds.

    The ``_seconds`` are errors times seconds: what a render of one second would have, as errors
    fall as 1/time. ``mean_ratio`` is the mean over that of the reference; ``block_deviation`` the
    root mean square, over blocks, of the difference to the reference in standard errors: about 1
    where they agree.
    """

    integrator: str
    chosen: str  # by auto; else the integrator
    samples: float  # per pixel
    seconds: float
    rel_mse: float
    rel_mse_error: float
    rel_mse_seconds: float
    trimmed_rel_mse: float  # without the worst thousandth of the pixels
    trimmed_rel_mse_error: float
    trimmed_rel_mse_seconds: float
    block_rel_mse: float
    block_rel_mse_error: float
    block_rel_mse_seconds: float
    spread: float  # standard deviation of the mean over seeds / mean
    b_spread: float | None  # of mlt: what the bootstrap says about b, cv/√N
    mean_ratio: float
    mean_ratio_error: float
    block_deviation: float


def render(scene: Scene, integrator: IntegratorName, samples: int, depth: int, seed: int) -> Timed:
    """Render on one thread and take the time."""
    settings = Settings(
        integrator=integrator, samples=samples, depth=depth, seed=seed, threads=1, filter="box"
    )
    start = process_time()
    rendering = Rendering(scene, settings)
    rendering.run()
    seconds = process_time() - start
    with no_warnings():
        image = rendering.image()
    return Timed(image["color"].astype(np.float64), seconds, str(rendering.integrator), image.stats)


def samples_for(scene: Scene, integrator: IntegratorName, seconds: float, depth: int) -> int:
    """Samples per pixel that take so many seconds of processor time, from a shorter render."""
    seed = FIRST_SEEDS["calibration"]
    samples = 4
    while True:
        timed = render(scene, integrator, samples, depth, seed)
        rate = timed.stats["samples_per_pixel"] / max(timed.seconds, 1e-3)
        wanted = min(max(1, round(float(rate * seconds))), UNLIMITED_SAMPLES)
        if timed.seconds >= min(seconds / 4, 1.0) or samples >= wanted:
            return wanted
        samples = min(4 * samples, wanted)


def make_reference(scene: Scene, seconds: float, depth: int) -> Reference:
    """Of the first integrator whose pictures can be one; else of the last.

    ``seconds``: of processor time, for the whole of it. :class:`usdmlt.Error` where no light is
    found: there is nothing for errors to be relative to.
    """
    for integrator in REFERENCES:
        samples = samples_for(scene, integrator, seconds / BATCHES, depth)
        first = FIRST_SEEDS["reference"]
        timed = [
            render(scene, integrator, samples, depth, seed)
            for seed in range(first, first + BATCHES)
        ]
        reference = Reference(integrator, [t.picture for t in timed], sum(t.seconds for t in timed))
        lit = np.any(reference.batches)
        if lit and reference.fireflies < 0.5 and reference.rel_mse < 1:
            break
    if not lit:
        raise Error("no light was found that reaches the camera: there are no errors to compare")
    return reference


def measure(
    scene: Scene,
    integrator: IntegratorName,
    reference: Reference,
    seconds: float,
    seeds: int,
    depth: int,
) -> Row:
    """Render a scene in so many seconds of processor time by every seed."""
    samples = samples_for(scene, integrator, seconds, depth)
    timed = [render(scene, integrator, samples, depth, seed) for seed in range(seeds)]
    pictures = [t.picture for t in timed]
    cpu = float(np.mean([t.seconds for t in timed]))
    parts = reference.parts
    pixel, pixel_error = mean_and_error([relative_error(p, parts) for p in pictures])
    trimmed, trimmed_error = mean_and_error([relative_error(p, parts, WORST) for p in pictures])
    block_parts = tuple(blocks(p) for p in parts)
    block, block_error = mean_and_error([relative_error(blocks(p), block_parts) for p in pictures])
    means = [p.mean() for p in pictures]
    mean, mean_error = mean_and_error(means)
    expected, expected_error = mean_and_error([p.mean() for p in reference.batches])
    ratio = mean / expected
    b_spread = [t.stats["b_error"] / t.stats["b"] for t in timed if t.stats.get("b")]
    return Row(
        integrator=integrator,
        chosen=timed[0].integrator,
        samples=float(np.mean([t.stats["samples_per_pixel"] for t in timed])),
        seconds=cpu,
        rel_mse=pixel,
        rel_mse_error=pixel_error,
        rel_mse_seconds=pixel * cpu,
        trimmed_rel_mse=trimmed,
        trimmed_rel_mse_error=trimmed_error,
        trimmed_rel_mse_seconds=trimmed * cpu,
        block_rel_mse=block,
        block_rel_mse_error=block_error,
        block_rel_mse_seconds=block * cpu,
        spread=float(np.std(means, ddof=1)) / expected,
        b_spread=float(np.mean(b_spread)) if b_spread else None,
        mean_ratio=ratio,
        mean_ratio_error=float(np.hypot(mean_error, ratio * expected_error)) / expected,
        block_deviation=block_deviation(pictures, reference.batches),
    )


def relative_error(picture: Picture, parts: tuple[Picture, ...], worst: float = 0.0) -> float:
    """relMSE of a picture against A, B and R; see the module. It may come out below 0.

    ``worst``: the share of the pixels, those with the largest errors, that is left out.
    """
    i, a, b, r = (_scaled(p) for p in (picture, *parts))
    errors = np.sort(((i - a) * (i - b) / (r**2 + 0.01)).mean(axis=-1), axis=None)
    return float(np.mean(errors[: errors.size - round(worst * errors.size)]))


def _scaled(picture: Picture) -> Picture:
    """To mean 1; black stays black."""
    return picture / (picture.mean() or 1.0)


def blocks(picture: Picture) -> Picture:
    """Means of blocks of 16x16 pixels; those at the right and at the bottom may be smaller."""
    sums, counts = picture, np.ones((*picture.shape[:2], 1))
    for axis in (0, 1):
        starts = np.arange(0, picture.shape[axis], BLOCK)
        sums, counts = (np.add.reduceat(values, starts, axis) for values in (sums, counts))
    return sums / counts


def block_deviation(pictures: list[Picture], others: list[Picture]) -> float:
    """Root mean square over blocks of the difference of two sets in its standard errors.

    Errors are estimated from the sets themselves: with 8 and 12 pictures a little more than 1 is to
    be expected. Fireflies that one set has not met make it larger: errors do not know of them.
    """
    sets = [np.array([blocks(p).mean(axis=-1) for p in s]) for s in (pictures, others)]
    difference = sets[0].mean(axis=0) - sets[1].mean(axis=0)
    variance = sum(s.var(axis=0, ddof=1) / len(s) for s in sets)
    seen = variance > 0
    return float(np.sqrt(np.mean(difference[seen] ** 2 / variance[seen]))) if seen.any() else 0.0


def mean_and_error(values: list[float]) -> tuple[float, float]:
    """The mean of independent values and its standard error."""
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))
