"""The choice of the integrator: which is best for a scene, by short pilots of each.

Pilots are small pictures of the scene that are thrown away. Their errors, relative to what the
others see too, times the rays they took are the figure of merit:

    e(I) = mean((I - A)(I - B) / (R^2 + 0.01)),

with the picture's mean scaled to 1, A and B two pilots of mlt, independent of I and of each other,
and R the mean of all. What an integrator has not found counts as its error. The light that path
tracing and bidirectional path tracing find too seldom to be seen in a short pilot is judged by the
chains of mlt, from the densities with which the others make their paths; so is what mlt wins by
taking it from bidirectional samples. Where an error hangs on few samples of either kind, it is not
believed, and mlt is taken. Work is counted in rays, never in seconds, so that the choice is the
same on every machine.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from usdmlt import native

if TYPE_CHECKING:
    from usdmlt import _core
    from usdmlt.settings import Settings

logger = logging.getLogger("usdmlt")

Integrator = Literal["path", "bdpt", "mlt"]

PIXELS = 2304  # of a pilot, about
SHARE = 0.05  # of the render's work, at most
# Of the work, what may be spent on mlt's own pilot, which is about as large as these.
CHAINS_SHARE = 0.25
# Rays of all pilots together, about, and of a sample of the path tracer: to tell beforehand whether
# they fit.
PILOT_RAYS = 650_000
RAYS_PER_SAMPLE = 4
SAMPLES: dict[Integrator, int] = {"path": 4, "bdpt": 2, "mlt": 8}
# Processor time of a ray with what belongs to it, relative to the path tracer's.
COST: dict[Integrator, float] = {"path": 1.0, "bdpt": 1.05, "mlt": 1.4}
# Fewer pixels, or paths of the chains, than these that make up an error: too few to believe it.
FEWEST_PIXELS, FEWEST_PATHS = 40.0, 400.0
# What the chains foresee of an error matters from this part of it on.
NOTABLE = 0.4
# Bidirectional samples are stratified, and better than the chains foresee.
MARGIN = 1.7
# Errors of chains are shared by neighbours, which is worse than the same error by pixel tells.
CLUMPS = 2.4
PILOT_SEED = 0x70696C6F


@dataclass(frozen=True)
class Choice:
    """What was chosen and why: ``merit`` is error times work by integrator, lower is better."""

    integrator: Integrator
    reason: str
    merit: dict[str, float]
    rays: int  # that the pilots took


def choose(core_scene: _core.Scene, settings: Settings) -> Choice:
    """The integrator that ``settings`` ask for; of ``"auto"``, the one that suits the scene best.

    Pilots take at most about :data:`SHARE` of the render's work; where they do not fit, none run,
    and mlt is taken, unless its own pilot does not fit either: on easy scenes it is worse by half,
    on hard ones the others are worse by orders of magnitude.
    """
    if settings.integrator != "auto":
        return Choice(settings.integrator, "it was asked for", {}, 0)
    if settings.mutations is not None or settings.mutation_weights is not None:
        return Choice("mlt", "mutations are asked for", {}, 0)
    pixels = core_scene.width * core_scene.height
    budget = settings.resolved_samples * pixels * RAYS_PER_SAMPLE
    if not core_scene.has_lights:
        return Choice("path", "there are no lights", {}, 0)
    if settings.depth < 3:
        return Choice("path", "only direct light is asked for", {}, 0)
    if SHARE * budget < PILOT_RAYS:
        return Choice(
            "mlt" if CHAINS_SHARE * budget >= PILOT_RAYS else "bdpt",
            "the render is too short to try others",
            {},
            0,
        )

    narrowest = min(core_scene.width, core_scene.height)
    reduction = max(min(int(np.sqrt(pixels / PIXELS)), narrowest), 1)
    rays = 0

    def pilot(integrator: Integrator, number: int) -> tuple[npt.NDArray[Any], dict[str, Any]]:
        nonlocal rays
        render = native.core().Render(
            core_scene,
            integrator=integrator,
            samples=SAMPLES[integrator],
            depth=settings.depth,
            seed=(settings.seed ^ PILOT_SEED) + number * 2**32,
            filter="box",
            error_layer=False,
            two_stage=settings.two_stage,
            reduction=reduction,
        )
        render.run(render.units_total, threads=settings.resolved_threads)
        stats = render.stats()
        rays += stats["rays"] + stats.get("mlt", {}).get("pilot_rays", 0)
        return render.image()[..., :3].astype(np.float64), stats

    (a, stats_a), (b, stats_b) = pilot("mlt", 0), pilot("mlt", 1)
    names: tuple[Integrator, ...] = ("path", "bdpt")
    others = {name: (pilot(name, 0), pilot(name, 1)) for name in names}
    reference = np.mean([a, b, *(p for pair in others.values() for p, _ in pair)], axis=0)
    mean = reference.mean()
    if not mean > 0:
        return Choice("mlt", "no pilot found light", {}, rays)
    weight = 1 / (reference**2 + 0.01 * mean**2)

    mlt_error = float(np.mean((a - b) ** 2 / 2 * weight))
    merit = {"mlt": mlt_error * stats_a["rays"] * COST["mlt"]}
    believed: list[Integrator] = ["mlt"]
    for name, ((first, stats), (second, _)) in others.items():
        # One sample's error: with what it lacks, and at least the spread of two pictures.
        lacking = np.mean([(p - a) * (p - b) * weight for p in (first, second)], axis=(0, 3))
        spread = ((first - second) ** 2 / 2 * weight).mean(axis=2)
        error = max(float(lacking.mean()), float(spread.mean())) * SAMPLES[name]
        by_chains = np.array([s["mlt"][f"{name}_error"] for s in (stats_a, stats_b)])
        foreseen, paths = float(by_chains[:, 0].mean()), float(by_chains[:, 1].sum())
        merit[name] = max(error, foreseen) * stats["rays"] / SAMPLES[name] * COST[name]
        clear = min(_effective_pixels(lacking), _effective_pixels(spread)) >= FEWEST_PIXELS
        if clear and (paths >= FEWEST_PATHS or foreseen <= NOTABLE * error):
            believed.append(name)
    # Chains take the paths that bidirectional samples find too seldom: what is won by that.
    gain = np.mean([s["mlt"]["error_relative_to_bdpt"] for s in (stats_a, stats_b)])
    merit["mlt"] = CLUMPS * min(merit["mlt"], merit["bdpt"] * float(gain) * MARGIN)
    best = min(believed, key=lambda name: merit[name])
    doubted = [name for name in names if name not in believed]
    reason = "least error for its work"
    if best == "mlt" and doubted:
        reason = f"the error of {' and '.join(doubted)} hangs on few samples"
    return Choice(best, reason, merit, rays)


def _effective_pixels(errors: npt.NDArray[Any]) -> float:
    """(sum of magnitudes)^2 / sum of squares: the number of pixels that an error comes from."""
    squares = float(np.sum(errors**2))
    return float(np.sum(np.abs(errors))) ** 2 / squares if squares > 0 else float(errors.size)
