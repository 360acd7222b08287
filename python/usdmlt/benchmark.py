"""What the integrators do per second of processor time, beside Embree alone and Mitsuba 3.

Renders of independent seeds of one integrator differ by its noise alone, so

    relMSE = mean((a - b)^2 / 2 / (m^2 + 0.01)),

over pairs of pictures (a, b) scaled to mean 1 and the mean m of the others, needs no reference. It
falls as 1/time: relMSE times seconds is the figure of merit, and lower is better. It cannot see
what all seeds have in common, such as light that none of them found; :mod:`usdmlt.equal_time` can.
"""

from __future__ import annotations

import itertools
import os
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from usdmlt import native
from usdmlt.settings import Settings
from usdmlt.testing.mitsuba import Untranslated

if TYPE_CHECKING:
    from usdmlt.scene import Scene
    from usdmlt.settings import ResolvedIntegrator

SEEDS = 4
REPLAYED_RAYS = 1_000_000


@dataclass(frozen=True)
class Measurement:
    """One row: rates per second of processor time; None where a renderer does not tell.

    ``samples``: camera samples; of mlt, mutations, whatever else the render did meanwhile. Chains
    have all light here, that what is measured is they.
    """

    renderer: str
    samples_per_second: float
    rays_per_sample: float | None
    rays_per_second: float | None
    embree_rays_per_second: float | None  # Embree alone, replaying the render's own rays
    rel_mse_seconds: float
    mean: float


def measure(scene: Scene, integrator: ResolvedIntegrator, samples: int, depth: int) -> Measurement:
    """Render a scene :data:`SEEDS` times on one thread."""
    core_scene = native.build_scene(scene, "avx2")
    pictures = []
    samples_done = rays = seconds = 0.0
    for seed in range(SEEDS):
        settings = Settings(
            samples=samples, depth=depth, seed=seed, threads=1, filter="box", selective=False
        )
        render = native.plan_render(core_scene, settings, integrator)
        render.run(render.units_total, threads=1)
        stats = render.stats()
        samples_done += stats["mlt"]["mutations"] if integrator == "mlt" else stats["samples"]
        rays += stats["rays"]
        seconds += stats["cpu_seconds"]
        pictures.append(render.image()[..., :3])
    return Measurement(
        integrator,
        samples_done / seconds,
        rays / samples_done if samples_done else None,
        rays / seconds,
        render.replay_rays_per_cpu_second(REPLAYED_RAYS),
        rel_mse(pictures) * seconds / SEEDS,
        float(np.mean(pictures)),
    )


def measure_mitsuba(scene: Scene, samples: int, depth: int) -> Iterator[Measurement | str]:
    """Mitsuba 3's path integrator in each variant that runs here; a line where one does not.

    Each in a process of its own: a compiler that does not know the processor ends it.
    """
    if find_spec("mitsuba") is None:
        yield "Mitsuba 3 is not installed"
        return
    for variant in ("scalar_rgb", "llvm_ad_rgb"):
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "stderr"
            with ProcessPoolExecutor(
                1, mp_context=get_context("spawn"), initializer=_write_errors_to, initargs=(log,)
            ) as process:
                try:
                    yield process.submit(
                        _measure_variant, variant, scene, samples, depth, Path(folder)
                    ).result()
                except Untranslated as error:
                    yield f"Mitsuba 3: the scene is not translated: {error}"
                    return
                except (ImportError, RuntimeError) as error:
                    told = log.read_text(errors="replace") if log.exists() else ""
                    if not isinstance(error, BrokenProcessPool) or not told:
                        told = str(error)
                    first = (told.strip() or type(error).__name__).splitlines()[0][:120]
                    yield f"Mitsuba 3 {variant} does not run here: {first}"


def _write_errors_to(log: Path) -> None:
    os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT), 2)


def _measure_variant(
    variant: str, scene: Scene, samples: int, depth: int, folder: Path
) -> Measurement:
    import mitsuba as mi

    from usdmlt.testing import mitsuba as bridge

    mi.set_variant(variant)
    loaded = bridge.load(mi, scene, folder, depth)
    np.array(mi.render(loaded, spp=1, seed=SEEDS))  # compiles, where there is a compiler
    start = process_time()
    pictures = [np.array(mi.render(loaded, spp=samples, seed=seed)) for seed in range(SEEDS)]
    seconds = process_time() - start
    return Measurement(
        f"Mitsuba 3 path, {variant}",
        SEEDS * samples * scene.width * scene.height / seconds,
        None,
        None,
        None,
        rel_mse(pictures) * seconds / SEEDS,
        float(np.mean(pictures)),
    )


def rel_mse(pictures: list[Any]) -> float:
    """Relative mean squared error of one picture, from three independent ones or more."""
    scaled = [np.asarray(p, np.float64) / np.mean(p) for p in pictures]
    total = np.sum(scaled, axis=0)
    errors = [
        np.mean((a - b) ** 2 / 2 / (((total - a - b) / (len(scaled) - 2)) ** 2 + 0.01))
        for a, b in itertools.combinations(scaled, 2)
    ]
    return float(np.mean(errors))
