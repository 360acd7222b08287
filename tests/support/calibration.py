"""How often the test of batches cries wolf: pairs of renders that differ in random numbers only.

cd tests; python -m support.calibration [INTEGRATOR,... [PAIRS [SCENE...]]]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy import stats

from usdmlt.rendering import Rendering, no_warnings
from usdmlt.settings import Settings
from usdmlt.stage import load
from usdmlt.testing.batches import batches_of
from usdmlt.testing.statistics import compare_batches

SCENES = Path(__file__).parents[2] / "scenes"
NAMES = ("cornell_box", "caustics", "door_ajar", "gallery", "pool", "snow_globe")
SIZE = {"width": 24, "height": 18}
SAMPLES = {"path": 48, "mlt": 24}


def pairs(name: str, integrator: str, count: int, first_stream: int = 0) -> np.ndarray:
    """(count, 2, batches, rows, columns, 4): all random numbers anew, but for the plan of mlt."""
    scene = load(SCENES / f"{name}.usda", **SIZE)
    out = []
    with no_warnings():
        settings = Settings(integrator=integrator, samples=SAMPLES[integrator])
        rendering = Rendering(scene, settings)
        for pair in range(count):
            out.append([])
            for side in range(2):
                stream = first_stream + 2 * pair + side
                out[-1].append(batches_of(rendering, stream=stream).pictures)
    return np.array(out)


def p_values(pictures: np.ndarray, **options: object) -> np.ndarray:
    """By pair."""
    return np.array([compare_batches(a, b, **options).p for a, b in pictures])


def resampled(pictures: np.ndarray, count: int, seed: int = 1, **options: object) -> np.ndarray:
    """p-values of pictures put together anew from all batches, none twice in a pair."""
    pool = pictures.reshape(-1, *pictures.shape[3:])
    batches = pictures.shape[2]
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        chosen = pool[rng.choice(len(pool), 2 * batches, replace=False)]
        out.append(compare_batches(chosen[:batches], chosen[batches:], **options).p)
    return np.array(out)


def interval(rate: float, count: int, confidence: float = 0.999) -> tuple[float, float]:
    """In which a binomial count over its number lies with this probability."""
    low, high = stats.binom.interval(confidence, count, rate)
    return float(low) / count, float(high) / count


def main() -> None:
    """Print the table."""
    integrators = sys.argv[1].split(",") if len(sys.argv) > 1 else SAMPLES
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    print(
        f"{'':<14}{'':<6}{'pairs':>6}{'KS p':>8}{'<= 5 %':>9}{'<= 1 %':>9}{'p = 1':>8}", flush=True
    )
    for integrator in integrators:
        for name in sys.argv[3:] or NAMES:
            p = p_values(pairs(name, integrator, count))
            ks = stats.kstest(p, "uniform").pvalue
            print(
                f"{name:<14}{integrator:<6}{count:>6}{ks:>8.3f}{np.mean(p <= 0.05):>9.2%}"
                f"{np.mean(p <= 0.01):>9.2%}{np.mean(p == 1):>8.2%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
