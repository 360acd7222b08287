"""How often the test of batches cries wolf: pairs of renders that differ in random numbers only.

cd tests; python -m support.calibration [KIND,… [PAIRS [SCENE…]]] [--keep FOLDER] [--resampled N]

A kind is one of KINDS, such as `mlt`, or two that are compared with each other, `path-bdpt`. With
`_eased` a scene has the changes that make its light easier to find.
Pictures are kept in the folder by slices, so that what was interrupted goes on. With a number for
``--resampled``, so many pairs are put together from batches of 50, and alarms at 1e-4 are counted.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from support.eased import EASED, open_scene
from usdmlt import files
from usdmlt.rendering import Rendering, no_warnings
from usdmlt.settings import Settings
from usdmlt.stage import load
from usdmlt.testing import exchange
from usdmlt.testing.batches import batches_of, means
from usdmlt.testing.statistics import SIGNIFICANCE, TOLERANCE, compare_batches

NAMES = ("cornell_box", "caustics", "door_ajar", "gallery", "pool", "snow_globe")
SIZE = {"width": 24, "height": 18}
KINDS: dict[str, dict[str, Any]] = {
    "path": {"integrator": "path", "samples": 48},
    "mlt": {"integrator": "mlt", "samples": 24},
    "chains": {"integrator": "mlt", "samples": 24, "selective": False},
    "bdpt": {"integrator": "bdpt", "samples": 24},
    "path1": {"integrator": "path", "samples": 24},  # per batch 1
    "path16": {"integrator": "path", "samples": 384},
}
SLICE = 50


def pairs(name: str, kind: str, count: int, first: int = 0) -> np.ndarray:
    """(count, 2, batches, rows, columns, 4): all random numbers anew; a pair shares its plan."""
    shipped = name.removesuffix("_eased")
    scene = load(open_scene(shipped, EASED[shipped] if shipped != name else None), **SIZE)
    out = []
    with no_warnings():
        for pair in range(first, first + count):
            rendering = Rendering(scene, Settings(seed=pair, **KINDS[kind]))
            out.append([batches_of(rendering, stream=side).pictures for side in (1, 2)])
    return np.array(out)


def slices(name: str, kind: str, count: int, folder: Path | None) -> Iterator[np.ndarray]:
    """The same by slices, which are read where they are kept."""
    for first in range(0, count, SLICE):
        path = folder and folder / f"{name}-{kind}-{first:05}.npy"
        if path and path.exists():
            yield np.load(path)
            continue
        made = pairs(name, kind, SLICE, first)
        if path:
            with files.replacing(path) as temporary, open(temporary, "wb") as file:
                np.save(file, made)
        yield made


def p_values(pictures: np.ndarray, **options: Any) -> np.ndarray:
    """By pair; between the steps that p of so many sets of signs has, 64/64, 64/65, …, at random,
    without which 1.5 % of them are 1."""
    outcomes = [compare_batches(a, b, **options) for a, b in pictures]
    steps = np.random.default_rng(1).random(len(outcomes))
    return np.array([x.p - step * x.p / x.tried for x, step in zip(outcomes, steps, strict=True)])


def p_values_of(name: str, kind: str, count: int, folder: Path | None = None) -> np.ndarray:
    """Of pairs of one kind, or of two kinds."""
    one, _, other = kind.partition("-")
    sliced = slices(name, one, count, folder)
    if not other:
        return np.concatenate([p_values(pictures) for pictures in sliced])[:count]
    with_others = zip(sliced, slices(name, other, count, folder), strict=True)
    unlike = (np.stack([a[:, 0], b[:, 1]], axis=1) for a, b in with_others)
    return np.concatenate([p_values(pictures, alike=False) for pictures in unlike])[:count]


def resampled(pictures: np.ndarray, count: int, first: int = 0, level: float = SIGNIFICANCE) -> int:
    """How many of so many pictures put together anew from all batches, none twice in a pair, have
    p at most ``level``.

    Cells are means of 4 x 4 pixels.
    """
    pool = means(pictures.reshape(-1, *pictures.shape[3:]), 4).astype(np.float64)
    batches = pictures.shape[2]
    enough = int(level * exchange.MOST_SIGNS) + 1  # of so many, p is above the level
    alarms = 0
    for pair in range(first, first + count):
        rng = np.random.default_rng(pair)
        chosen = pool[rng.choice(len(pool), 2 * batches, replace=False)]
        parts = exchange.looks(chosen[:batches], chosen[batches:], 1, TOLERANCE)
        alarms += exchange.p_value(parts, batches, enough)[0] <= level
    return alarms


def interval(rate: float, count: int, confidence: float = 0.999) -> tuple[float, float]:
    """In which a binomial count over its number lies with this probability."""
    low, high = stats.binom.interval(confidence, count, rate)
    return float(low) / count, float(high) / count


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="?", default="path,mlt")
    parser.add_argument("pairs", nargs="?", type=int, default=1000)
    parser.add_argument("scenes", nargs="*", default=NAMES)
    parser.add_argument("--keep", metavar="FOLDER", type=Path)
    parser.add_argument("--resampled", metavar="N", type=int, help="alarms at 1e-4 among so many")
    arguments = parser.parse_args()
    count = arguments.pairs
    if arguments.resampled:
        for kind, name in itertools.product(arguments.kinds.split(","), arguments.scenes):
            pictures = next(slices(name, kind, SLICE, arguments.keep))
            alarms = resampled(pictures, arguments.resampled)
            print(f"{name:<14}{kind:<14}{arguments.resampled:>8}: {alarms}", flush=True)
        return
    print(f"{'':<14}{'':<14}{'pairs':>6}{'KS p':>8}{'<= 5 %':>9}{'<= 1 %':>9}{'least':>9}")
    for kind in arguments.kinds.split(","):
        for name in arguments.scenes:
            p = p_values_of(name, kind, count, arguments.keep)
            ks = stats.kstest(p, "uniform").pvalue
            print(
                f"{name:<14}{kind:<14}{count:>6}{ks:>8.3f}{np.mean(p <= 0.05):>9.2%}"
                f"{np.mean(p <= 0.01):>9.2%}{p.min():>9.1e}",
                flush=True,
            )


if __name__ == "__main__":
    main()
