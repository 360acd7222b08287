"""Pictures for tests: from a scene description straight through the core."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from usdmlt.embree import find_library
from usdmlt.native import core
from usdmlt.scene import Scene

BOTH = ("path", "bdpt")
ALL = (*BOTH, "mlt")


def build(scene: Scene):
    """The core's scene."""
    return core().Scene(scene, str(find_library()))


def work(integrator: str, samples: int) -> dict[str, object]:
    """Settings that leave about as little noise as `samples` camera samples per pixel: chains need
    more mutations than that, and take paths of every length here."""
    if integrator == "mlt":
        return {"samples": 8 * samples, "direct": "mlt"}
    return {"samples": samples}


def plan(scene, integrator: str = "path", **settings: object):
    """A render that is yet to run. The pixel filter is a box unless told otherwise."""
    settings.setdefault("filter", "box")
    if isinstance(scene, Scene):
        scene = build(scene)
    return core().Render(scene, integrator=integrator, **settings)


def picture(scene, integrator: str = "path", threads: int = 1, **settings: object) -> np.ndarray:
    """One finished picture, (height, width, 3) float64."""
    return rgba(scene, integrator, threads, **settings)[..., :3].astype(np.float64)


def rgba(scene, integrator: str = "path", threads: int = 1, **settings: object) -> np.ndarray:
    """One finished picture with alpha, float32."""
    render = plan(scene, integrator, **settings)
    render.run(render.units_total, threads)
    stats = render.stats()
    assert stats["non_finite"] == 0, f"{stats['non_finite']} samples were not finite"
    assert stats["overflows"] == 0
    return render.image()


def pictures(scene, integrator: str, seeds: int | Iterable[int], **settings: object) -> np.ndarray:
    """Pictures of independent seeds, (seeds, height, width, 3)."""
    built = build(scene) if isinstance(scene, Scene) else scene
    seeds = range(seeds) if isinstance(seeds, int) else seeds
    return np.stack([picture(built, integrator, seed=seed, **settings) for seed in seeds])


def picture_sums(render) -> np.ndarray:
    """Samples and splats of the picture together, (height, width, 3) integers."""
    planes = render.film.planes()
    sums = planes["samples"][..., :3].copy()
    return sums + planes["splats"] if "splats" in planes else sums


def layer_sums(render, index: int) -> np.ndarray:
    """Those of a layer, (height, width, 3) integers."""
    return render.film.planes()["layers"][:, :, index].copy()
