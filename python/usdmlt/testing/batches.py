"""Pictures rendered as independent batches: the mean, its error, and all that a test needs."""

from __future__ import annotations

import hashlib
import os
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from usdmlt import layers, native
from usdmlt._version import __version__
from usdmlt.errors import UsageError
from usdmlt.image import Image
from usdmlt.rendering import Rendering, no_warnings, read
from usdmlt.scene import Scene
from usdmlt.settings import Settings, merged
from usdmlt.testing.cells import LUMINANCE
from usdmlt.testing.statistics import BATCHES

if TYPE_CHECKING:
    from pxr import Usd


SURFACES = ("centre", "average")  # sources of layers


@dataclass(repr=False)
class Batches(Image):
    """A picture that is the mean of independent ones, with the error that they show.

    Its layer ``"error"`` is the standard error of the luminance from the spread of the batches.
    ``pictures``: (batches, rows, columns, 4) float32: linear RGB, premultiplied, and alpha, means
    over ``cell`` x ``cell`` pixels. ``made``: how: options, resolved settings, versions, the
    stage's hash; what JSON has. ``bits``: a hash of the pictures as they were rendered; ``scale``:
    that of the halves they were read from.
    """

    pictures: npt.NDArray[np.float32] = field(
        default_factory=lambda: np.zeros((0, 0, 0, 4), np.float32), repr=False
    )
    cell: int = 1
    made: dict[str, Any] = field(default_factory=dict)
    bits: str = ""
    scale: float = 1.0


def bits_of(pictures: npt.NDArray[np.float32]) -> str:
    """A hash of every bit."""
    return hashlib.sha256(np.ascontiguousarray(pictures).tobytes()).hexdigest()


def means(pictures: npt.NDArray[np.float32], size: int) -> npt.NDArray[np.float32]:
    """Means over size x size pixels of (n, h, w, c); at the right and bottom of what is left."""
    out = pictures.astype(np.float64)
    for axis in (1, 2):
        starts = np.arange(0, out.shape[axis], size)
        counts = np.diff([*starts, out.shape[axis]])
        shape = [1] * out.ndim
        shape[axis] = -1
        out = np.add.reduceat(out, starts, axis) / counts.reshape(shape)
    return out.astype(np.float32)


def render_batches(
    stage: Usd.Stage | Scene | str | os.PathLike[str],
    *,
    batches: int = BATCHES,
    stream: int = 0,
    **options: Any,
) -> Batches:
    """Render a picture as independent batches of the same plan.

    ``options``: those of :func:`usdmlt.render` but for ``time``; ``samples`` are those of all
    batches together, at least one per batch. Of mlt a batch has one camera sample in every pixel at
    least, so there may be more. ``stream``: another set of random numbers for all but the plan;
    pictures of different streams are independent of each other. ``aovs``: layers of surfaces, which
    have no noise.
    """
    if options.get("time") is not None:
        raise UsageError("a picture of independent batches has a number of samples, not a time")
    scene, given, reading = read(stage, options)
    asked = {k: v for k, v in scene.settings.items() if k not in ("time", "aovs")}
    noisy = [x.name for x in layers.resolve(given.get("aovs", ())) if x.source not in SURFACES]
    if noisy:
        raise UsageError(f"layers of light paths are no part of checks: {', '.join(noisy)}")
    image = batches_of(Rendering(scene, merged(asked, given)), batches, stream)
    image.made["options"] = reading
    image.made["stage_hash"] = "" if isinstance(stage, Scene) else stage_hash(stage)
    return image


def batches_of(rendering: Rendering, batches: int = BATCHES, stream: int = 0) -> Batches:
    """Batches by the plan of a rendering, which itself stays as it is.

    A plan has a say in how noise is distributed, so pictures to be compared should share it, as
    they do when only ``stream`` differs.
    """
    if batches < 2:
        raise UsageError(f"batches must be at least 2, not {batches}")
    started = perf_counter()
    settings = rendering.settings
    samples = max(-(-settings.resolved_samples // batches), 1)
    images = []
    for k in range(batches):
        # Ordinary seeds are below 2^32.
        part = rendering.again(settings.seed + ((stream * 4096 + k + 1) << 32), samples)
        part.run()
        with no_warnings() if k else nullcontext():  # once is enough
            images.append(part.image())
    pictures = np.stack([np.dstack([i["color"], i["alpha"]]) for i in images])
    mean = pictures.mean(axis=0, dtype=np.float64).astype(np.float32)
    seconds = perf_counter() - started
    spent = sum(i.stats["samples_per_pixel"] for i in images)
    first, surfaces = images[0], rendering.see_surfaces()
    return Batches(
        channels={
            "color": mean[..., :3],
            "alpha": mean[..., 3],
            "error": standard_error(pictures),
            **surfaces.channels,
        },
        layers=surfaces.layers,
        color_space=rendering.scene.color_space,
        stats=first.stats
        | {
            "samples_per_pixel": spent,
            "seconds": seconds,
            "rays": sum(i.stats["rays"] for i in images),
        },
        metadata=first.metadata
        | surfaces.metadata
        | {
            "mutations" if rendering.integrator == "mlt" else "samples": spent,
            "units": sum(i.stats["units_done"] for i in images),
            "time": seconds,
            "settings": None,  # those of a batch
        },
        pictures=pictures,
        bits=bits_of(pictures),
        made={
            "settings": _lasting(settings, rendering.integrator),
            "batches": batches,
            "stream": stream,
            "versions": versions(),
            "plan": first.stats.get("share_of_bidirectional_samples"),
        },
    )


def _lasting(settings: Settings, integrator: str) -> dict[str, Any]:
    """Settings that decide about the picture, as they were resolved."""
    kept = asdict(settings) | {
        "integrator": integrator,
        "samples": settings.resolved_samples,
        "mutations": None,
    }
    for name in ("threads", "time", "error", "aovs"):
        del kept[name]
    if settings.aovs:
        kept["aovs"] = [layer.name for layer in layers.resolve(settings.aovs)]
    return kept


def versions() -> dict[str, str]:
    """Of what has a say in the bits of a picture."""
    return {
        "usdmlt": __version__,
        "build": ", ".join(f"{k} {v}" for k, v in sorted(native.build_info().items())),
        "embree": native.embree_version(),
    }


def stage_hash(stage: Usd.Stage | str | os.PathLike[str]) -> str:
    """SHA-256 of the flattened stage, session layer included, wherever its files are.

    What assets hold, such as textures, is not in it, only their names.
    """
    from pxr import Usd

    opened = stage if isinstance(stage, Usd.Stage) else Usd.Stage.Open(os.fspath(stage))
    text = opened.Flatten(addSourceFileComment=False).ExportToString()
    folder = os.path.dirname(opened.GetRootLayer().realPath)
    if folder:
        text = text.replace(folder, ".")
    return hashlib.sha256(text.encode()).hexdigest()


def standard_error(pictures: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
    """Of the mean luminance by pixel, from the spread of the batches."""
    luminance = pictures[..., :3].astype(np.float64) @ LUMINANCE
    error = luminance.std(axis=0, ddof=1) / np.sqrt(len(luminance))
    return np.asarray(error, dtype=np.float32)
