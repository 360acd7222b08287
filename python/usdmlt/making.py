"""What a picture says about its making: in words, as EXR's matrices, and to be repeated.

``settings`` of the metadata is JSON: the stage, the options of :func:`usdmlt.load` that differ from
their defaults, the fields of :class:`usdmlt.Settings` and the work units: all that the same bits
need.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from datetime import datetime, timezone
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from usdmlt import exr
from usdmlt._version import __version__
from usdmlt.errors import Error
from usdmlt.image_files import one_line
from usdmlt.options import LoadOptions
from usdmlt.scene import Camera, Scene
from usdmlt.settings import Settings

Matrix = npt.NDArray[np.float64]

# They say how fast, or where it was stopped, which the number of units says: not what.
_NOT_KEPT = ("threads", "time", "target_error")


@dataclass(frozen=True)
class Making:
    """How a picture was made, as its file says. ``options``: of :func:`usdmlt.load`.
    ``units``, ``samples_per_pixel``: how much of the work was done."""

    stage: str
    options: dict[str, Any]
    settings: dict[str, Any]
    units: int
    samples_per_pixel: float
    version: str


def metadata(scene: Scene, settings: Settings, stats: dict[str, Any]) -> dict[str, Any]:
    """:attr:`Image.metadata` of a render."""
    resolved = stats["settings"]
    window: Any = scene.metadata.get("data_window")
    world_to_camera, world_to_ndc = exr_camera(scene.camera, window)
    spent = "mutations" if resolved["integrator"] == "mlt" else "samples"
    return {
        "data_window": window and asdict(window),
        "renderer": f"usdmlt {__version__}",
        "Software": f"usdmlt {__version__}",
        "stage": scene.metadata.get("stage"),
        "frame": scene.metadata.get("frame"),
        "frames_per_second": scene.metadata.get("frames_per_second"),
        "date": datetime.now(timezone.utc).strftime("%Y:%m:%d %H:%M:%S"),
        "camera": scene.camera.name or None,
        "integrator": resolved["integrator"],
        spent: stats["samples_per_pixel"],
        "units": stats["units_done"],
        "depth": resolved["depth"],
        "filter": resolved["filter"],
        "seed": resolved["seed"],
        "time": stats.get("seconds"),
        "pixel_aspect_ratio": _pixel_aspect_ratio(scene),
        "worldToCamera": world_to_camera,
        "worldToNDC": world_to_ndc,
        "settings": encoded(making(scene, settings, stats), stats["units"]),
    }


def read_making(path: str | os.PathLike[str]) -> Making:
    """How the picture of an EXR was made; :class:`usdmlt.Error` where it does not say."""
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(os.fspath(path))
    if file is None:
        raise Error(f"cannot read {path}: {one_line(oiio.geterror())}")
    kept = exr.read_metadata(file.spec())
    file.close()
    try:
        making = Making(**json.loads(kept["settings"]))
        unknown = making.options.keys() - {field.name for field in fields(LoadOptions)}
        unknown |= making.settings.keys() - {field.name for field in fields(Settings)}
        Settings(**{n: v for n, v in making.settings.items() if n not in unknown})
    except (AttributeError, KeyError, TypeError, ValueError):
        made = kept.get("renderer")
        reason = f"it was made by {made}" if made else "it was not made by usdmlt"
        if str(made).startswith("usdmlt"):
            reason = "its stage was open in Python, or it is the mean of several renders"
        raise Error(f"{path} does not say how to make it again: {reason}") from None
    if unknown:
        names = ", ".join(sorted(unknown))
        raise Error(f"{path} was made by usdmlt {making.version}, with {names}: unknown here")
    return making


def kept_options(options: LoadOptions) -> dict[str, Any]:
    """The options of reading that differ from their defaults, as JSON has them."""
    default = LoadOptions()
    kept = {field.name: getattr(options, field.name) for field in fields(options)}
    kept = {name: value for name, value in kept.items() if value != getattr(default, name)}
    if "session_layer" in kept:
        kept["session_layer"] = os.path.abspath(kept["session_layer"])
    if "search_paths" in kept:
        kept["search_paths"] = [os.path.abspath(path) for path in kept["search_paths"]]
    return kept


def making(scene: Scene, settings: Settings, stats: dict[str, Any]) -> dict[str, Any] | None:
    """The fields of :class:`Making`; None of a stage that was not read from a file alone."""
    if "options" not in scene.metadata:
        return None
    kept = {name: value for name, value in asdict(settings).items() if name not in _NOT_KEPT}
    if settings.mutations is None:
        kept["samples"] = settings.resolved_samples
    stage, options = str(scene.metadata["stage"]), cast(Any, scene.metadata["options"])
    done = stats["units_done"], stats["samples_per_pixel"]
    return asdict(Making(stage, options, kept, *done, __version__))


def encoded(making: dict[str, Any] | None, units: Sequence[Sequence[int]]) -> str | None:
    """As a picture's metadata have it; None where its units do not begin with the first, or have
    gaps: it cannot be told how to make it again."""
    is_prefix = [first for first, _ in units] in ([], [0])
    return json.dumps(making) if making and is_prefix else None


def _pixel_aspect_ratio(scene: Scene) -> float:
    """Width over height of a pixel."""
    left, right, bottom, top = scene.camera.window
    ratio = (right - left) / scene.width / ((top - bottom) / scene.height)
    return 1.0 if abs(ratio - 1) < 1e-4 else float(ratio)


def exr_camera(camera: Camera, data_window: Any = None) -> tuple[Matrix, Matrix]:
    """EXR's standard matrices, for row vectors: world to camera space, and on to the window.

    ``data_window``: the part of the picture that the camera sees; None: all of it.

    EXR's camera space is left-handed with +z forward; NDC is (0, 0) in the upper left corner of
    the picture and (1, 1) in the lower right one, after division by w.
    """
    world_to_camera = np.linalg.inv(camera.transform) @ np.diag([1.0, 1.0, -1.0, 1.0])
    left, right, bottom, top = camera.window
    if data_window is not None:
        pixel = (right - left) / data_window.width, (top - bottom) / data_window.height
        left, top = left - data_window.x * pixel[0], top + data_window.y * pixel[1]
        right = left + data_window.full_width * pixel[0]
        bottom = top - data_window.full_height * pixel[1]
    sx, sy = 1 / (right - left), 1 / (top - bottom)
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = sx, -sy
    if camera.projection == "perspective":
        projection[2] = [-left * sx, top * sy, 1.0, 1.0]
    else:
        projection[2, 2] = 1.0
        projection[3] = [-left * sx, top * sy, 0.0, 1.0]
    return world_to_camera, world_to_camera @ projection
