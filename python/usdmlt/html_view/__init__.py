"""A picture as one page of HTML, which needs no network: layers, exposure, zoom, pixel values.

The values are in the page as the EXR has them: the bytes of each channel side by side by
significance, deflated, in base64.
"""

from __future__ import annotations

import base64
import html
import json
import re
import zlib
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
import numpy.typing as npt

from usdmlt import color
from usdmlt.exr import CRYPTOMATTE
from usdmlt.image import Image
from usdmlt.layers import Layer

_POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
)
_LEVEL = 6  # of deflate
# Not of interest to one who looks at a picture, or a JSON text.
_LEFT_OUT = frozenset({"worldToCamera", "worldToNDC", "settings", "Software", "data_window"})


def page(image: Image, title: str) -> str:
    """The whole file."""
    return Template(_text("viewer.html")).substitute(
        policy=_POLICY,
        title=html.escape(title),
        style=_text("viewer.css"),
        script=_text("viewer.js"),
        picture=json.dumps(picture(image)).replace("<", "\\u003c"),
    )


def picture(image: Image) -> dict[str, Any]:
    """What the page's script is given; JSON has it all."""
    return {
        "width": image.width,
        "height": image.height,
        "colorSpace": image.color_space,
        "toRec709": color.conversion(image.color_space, color.DEFAULT).tolist(),
        "layers": [
            _layer(image.layer(name), pixels) | {"names": _names(name, image.metadata)}
            for name, pixels in image.channels.items()
        ],
        "about": {
            name: f"{value:.6g}" if isinstance(value, float) else str(value)
            for name, value in image.metadata.items()
            if value is not None and name not in _LEFT_OUT and not _is_manifest(name)
        },
    }


def _layer(layer: Layer, pixels: npt.NDArray[Any]) -> dict[str, Any]:
    planes = np.moveaxis(pixels[..., None] if pixels.ndim == 2 else pixels, -1, 0)
    stored = planes.astype(layer.dtype)
    if layer.half:
        with np.errstate(over="ignore"):
            half = planes.astype(np.float16)
        if np.array_equal(half.astype(np.float32), planes, equal_nan=True):
            stored = half
    size = stored.dtype.itemsize
    shuffled = stored.astype(stored.dtype.newbyteorder("<")).tobytes()
    by_significance = np.frombuffer(shuffled, np.uint8).reshape(-1, size).T.tobytes()
    return {
        "name": layer.name,
        "kind": "scalar" if layer.source == "measured" and layer.kind == "id" else layer.kind,
        "channels": [channel.rpartition(".")[2] for channel in layer.channels],
        "type": {"float16": "half", "float32": "float", "uint32": "uint"}[stored.dtype.name],
        "data": base64.b64encode(zlib.compress(by_significance, _LEVEL)).decode(),
    }


def _is_manifest(name: str) -> bool:
    return name.startswith(CRYPTOMATTE) or name.endswith("Ids")


def _names(layer: str, metadata: dict[str, Any]) -> dict[str, str]:
    """What the numbers of a layer stand for, those of Cryptomatte as the bits of their floats."""
    manifest = metadata.get(f"{layer}s")
    for key, value in metadata.items():
        is_of = key.startswith(CRYPTOMATTE) and key.endswith("/name")
        if is_of and re.fullmatch(re.escape(str(value)) + r"\d*", layer):
            manifest = metadata.get(key.removesuffix("name") + "manifest")
    try:
        numbers = json.loads(manifest or "{}")
        return {str(n if isinstance(n, int) else int(n, 16)): name for name, n in numbers.items()}
    except (TypeError, ValueError, AttributeError):
        return {}


def _text(name: str) -> str:
    return (files("usdmlt.html_view") / name).read_text(encoding="utf-8")
