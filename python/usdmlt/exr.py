"""EXR files of pictures: which channels, parts and attributes they have.

The picture is R, G, B, A; a layer N is N.X, N.Y, N.Z, as :mod:`usdmlt.layers` has it.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from usdmlt import color, layers
from usdmlt.errors import Error, UsageError
from usdmlt.image_files import COMPRESSIONS, EXACT_IDS, LOSSY, Channels, Part, read_parts
from usdmlt.options import check_choice

if TYPE_CHECKING:
    from usdmlt.image import Image

logger = logging.getLogger("usdmlt")

HALF_MAX = 65504.0
PixelType = Literal["half", "float"]
STATISTICS_PART = "batches"  # of a reference picture: no layer
FIRST_PART = "picture"
SUMS_PREFIX = "film."  # of the parts of a part file (usdmlt.parts): no layers
SHARED = ("chromaticities", "PixelAspectRatio", "framesPerSecond")  # of all parts of a file

# Attributes that EXR and OpenImageIO define, by their names in Image.metadata; all others are
# written as usdmlt:NAME.
_ATTRIBUTES = {
    "renderer": "renderer",
    "Software": "Software",
    "comments": "comments",
    "worldToCamera": "worldToCamera",
    "worldToNDC": "worldToNDC",
    "pixel_aspect_ratio": "PixelAspectRatio",
    "frames_per_second": "framesPerSecond",
    "date": "DateTime",
}
_NAMES = {attribute: name for name, attribute in _ATTRIBUTES.items()} | {
    "FramesPerSecond": "frames_per_second"
}
CRYPTOMATTE = "cryptomatte/"  # its metadata is called so in every file
_SUFFIX_ORDER = "RGBAXYZUVW"


@dataclass(frozen=True)
class Format:
    """How an EXR is written; ValueError for what cannot be.

    ``compression``: one of :data:`COMPRESSIONS`, with a level if wanted: "dwaa:100".
    ``pixel_type``: of colours and directions; all else is of floats or whole numbers.
    ``multipart``: each layer is a part of its own, of its name.
    """

    compression: str = "zip"
    pixel_type: PixelType = "half"
    multipart: bool = False

    def __post_init__(self) -> None:
        name, colon, level = self.compression.partition(":")
        check_choice("compression", name, COMPRESSIONS)
        if colon and not level.isdecimal():
            raise UsageError(f"compression {self.compression!r}: its level is a whole number")
        check_choice("pixel_type", self.pixel_type, get_args(PixelType))

    @property
    def lossy(self) -> bool:
        """Whether values change."""
        return self.compression.partition(":")[0] in LOSSY


def parts(image: Image, how: Format | None = None) -> list[Part]:
    """What an EXR of this picture holds. Warns of values that it cannot."""
    how = how or Format()
    others = [
        (image.layer(name), pixels)
        for name, pixels in image.channels.items()
        if name not in ("color", "alpha")
    ]
    apart = [layer for layer, pixels in others if how.multipart or _is_too_large(pixels)]
    _warn(image, how, apart)
    first = _channels(layers.KNOWN["color"], image["color"], how)
    first |= _channels(layers.KNOWN["alpha"], image["alpha"], how)
    together = [layer for layer, _ in others if layer not in apart]
    check_compression(how, together)
    for layer, pixels in others:
        if layer in together:
            first |= _channels(layer, pixels, how)
    attributes, window = _attributes(image, how), image.metadata.get("data_window")
    if apart:
        attributes["oiio:subimagename"] = FIRST_PART
    common = {name: attributes[name] for name in SHARED if name in attributes}
    result = [Part(first, attributes, window)]
    for layer, pixels in others:
        if layer in apart:
            is_color = layer.kind == "color"
            own = {
                "oiio:subimagename": layer.stem,
                "compression": how.compression if is_color or not how.lossy else "zip",
                "colorInteropID": image.color_space if is_color else "data",
            }
            result.append(Part(_channels(layer, pixels, how), common | own, window))
    return result


def read(path: str | os.PathLike[str]) -> tuple[dict[str, npt.NDArray[Any]], str, dict[str, Any]]:
    """Layers, colour space and metadata of an EXR; :class:`usdmlt.Error` where it is none."""
    try:
        found = list(read_parts(path))
    except OSError as error:
        raise Error(f"cannot read {path}: {error}") from None
    spec = found[0][0]
    channels = merged(found)
    if not {"R", "G", "B"} <= channels.keys():
        raise Error(f"cannot read {path}: it has no channels R, G, B but {', '.join(channels)}")
    # OpenImageIO before 3.1 renames what it finds in oiio:ColorSpace.
    space = spec.get_string_attribute("colorInteropID", color.DEFAULT)
    return _layers(channels), space, read_metadata(spec)


def merged(parts: Sequence[tuple[Any, Channels]]) -> Channels:
    """Channels of all parts as large as the first but for statistics and sums.

    Those whose names an earlier part has go by the name of their part besides.
    """
    channels: Channels = {}
    for number, (spec, more) in enumerate(parts):
        if _size(spec) == _size(parts[0][0]) and (not number or not _is_no_layer(spec)):
            for name, pixels in more.items():
                channels[f"{_part(spec, number)}.{name}" if name in channels else name] = pixels
    return channels


def of_other_sizes(parts: Sequence[tuple[Any, Channels]]) -> Channels:
    """Channels of the parts that are not as large as the first but for statistics."""
    return {
        f"{_part(spec, number)}.{name}": pixels
        for number, (spec, more) in enumerate(parts)
        if _size(spec) != _size(parts[0][0]) and not _is_no_layer(spec)
        for name, pixels in more.items()
    }


def _part(spec: Any, number: int) -> str:
    return str(spec.get_string_attribute("oiio:subimagename")) or f"part{number}"


def _size(spec: Any) -> tuple[int, int]:
    return spec.width, spec.height


def _is_no_layer(spec: Any) -> bool:
    name = str(spec.get_string_attribute("oiio:subimagename"))
    return name == STATISTICS_PART or name.startswith(SUMS_PREFIX)


def read_metadata(spec: Any) -> dict[str, Any]:
    """What a file says about its making, as :attr:`Image.metadata` has it."""
    metadata: dict[str, Any] = {}
    for attribute in spec.extra_attribs:
        name, value = attribute.name, attribute.value
        if name.startswith("usdmlt:"):
            if name == "usdmlt:part":
                continue  # of usdmlt.parts
            metadata[name.removeprefix("usdmlt:")] = value
        elif name in _NAMES:
            metadata[_NAMES[name]] = value
        elif name.startswith(CRYPTOMATTE):
            metadata[name] = value
    rate = metadata.get("frames_per_second")
    if isinstance(rate, tuple):
        metadata["frames_per_second"] = rate[0] / rate[1]
    x, y = spec.x - spec.full_x, spec.y - spec.full_y
    if (x, y, spec.width, spec.height) != (0, 0, spec.full_width, spec.full_height):
        metadata["data_window"] = {
            "x": x,
            "y": y,
            "width": spec.width,
            "height": spec.height,
            "full_width": spec.full_width,
            "full_height": spec.full_height,
        }
    return metadata


def _layers(channels: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Channels put together by what is before their last dot, in the order of `layers.KNOWN`."""
    groups: dict[str, list[str]] = {"color": ["R", "G", "B"]}
    for channel in channels:
        stem, dot, _ = channel.rpartition(".")
        if channel == "A":
            groups["alpha"] = ["A"]
        elif channel not in groups["color"]:
            groups.setdefault(stem if dot else channel, []).append(channel)
    result = {}
    for name, members in groups.items():
        members.sort(key=lambda channel: (_SUFFIX_ORDER + channel[-1]).index(channel[-1]))
        arrays = [np.asarray(channels[channel]) for channel in members]
        arrays = [a.astype(np.float32) if a.dtype.kind == "f" else a for a in arrays]
        result[name] = arrays[0] if len(arrays) == 1 else np.stack(arrays, axis=-1)
    result.setdefault("alpha", np.ones_like(result["color"][..., 0]))
    order = list(layers.KNOWN)  # EXR has channels by the alphabet
    return dict(sorted(result.items(), key=lambda item: [*order, item[0]].index(item[0])))


def _channels(layer: layers.Layer, pixels: npt.NDArray[Any], how: Format) -> Channels:
    columns = pixels[..., None] if pixels.ndim == 2 else pixels
    half = layer.half and how.pixel_type == "half"
    if half:
        columns = np.clip(columns, -HALF_MAX, HALF_MAX)
    columns = columns.astype(np.float16 if half else layer.dtype)
    return dict(zip(layer.channels, np.moveaxis(columns, -1, 0), strict=True))


def _attributes(image: Image, how: Format) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "compression": how.compression,
        "oiio:ColorSpace": image.color_space,
        "colorInteropID": image.color_space,
        "chromaticities": np.array(
            color.rendering_space(image.color_space).chromaticities.flat(), np.float32
        ),
    }
    for name, value in image.metadata.items():
        if value is None or name == "data_window":
            continue
        if name == "frames_per_second":
            value = _frame_rate(value)
        own = name if name.startswith(CRYPTOMATTE) else f"usdmlt:{name}"
        attributes[_ATTRIBUTES.get(name, own)] = value
    return attributes


def _frame_rate(rate: float) -> Fraction:
    """As a fraction: those of NTSC, 23.976 or 29.97, are of 1001."""
    ntsc = Fraction(round(rate * 1.001) * 1000, 1001)
    return ntsc if abs(rate - ntsc) < 1e-3 else Fraction(rate).limit_denominator(1000)


def check_compression(how: Format, together: Iterable[layers.Layer]) -> None:
    """Raise ValueError where layers of one part would be lost: hashes of names, which Cryptomatte
    keeps in colours, do not survive a lossy compression."""
    broken = [layer.name for layer in together if layer.kind == "rgba" and not layer.half]
    if how.lossy and broken:
        raise UsageError(
            f"{how.compression} would break {', '.join(broken)}: choose zip, zips or piz, or "
            "several parts, of which only colours are compressed so"
        )


def _is_too_large(pixels: npt.NDArray[Any]) -> bool:
    """Whether whole numbers are too large to be in one part with floats."""
    return pixels.dtype == np.uint32 and bool((pixels >= EXACT_IDS).any())


def _warn(image: Image, how: Format, apart: list[layers.Layer]) -> None:
    if not how.multipart:
        for layer in apart:
            logger.warning("%s is an EXR part of its own: it has numbers from 2^24 on", layer.name)
    if how.pixel_type == "float":
        return
    beyond = sum(
        int(np.count_nonzero(np.abs(pixels) > HALF_MAX))
        for name, pixels in image.channels.items()
        if image.layer(name).half
    )
    if beyond:
        logger.warning(
            "%d value%s beyond the range of half floats %s clamped to 65504",
            beyond,
            "s" if beyond > 1 else "",
            "were" if beyond > 1 else "was",
        )
