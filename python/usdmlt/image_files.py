"""Image files by OpenImageIO: parts of named channels, written whole and looked at again."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

# Arrays of (height, width) by the name they have in the file, in its order.
Channels = dict[str, npt.NDArray[Any]]
LOSSY = frozenset({"pxr24", "b44", "b44a", "dwaa", "dwab"})
COMPRESSIONS = ("none", "rle", "zip", "zips", "piz", *sorted(LOSSY))

# As OpenImageIO names them.
_FORMATS = {"float16": "half", "float32": "float", "uint8": "uint8", "uint32": "uint"}
# OpenImageIO takes the channels of a part as one type, floats, of which 1.0 is the largest uint32.
# On the way to whole numbers and back all below this one stay what they are.
EXACT_IDS = 2**24
_LARGEST = 2.0**32 - 1


@dataclass(frozen=True)
class Part:
    """Of a file: channels in its order, attributes, and where the pixels are in the whole picture.

    Only an EXR can have several; their attribute ``oiio:subimagename`` tells them apart.
    """

    channels: Channels
    attributes: dict[str, Any]
    data_window: dict[str, int] | None = None

    @property
    def pixels(self) -> npt.NDArray[Any]:
        """(height, width, channels), of the one type they have, or of floats."""
        channels = list(self.channels.values())
        kinds = {channel.dtype for channel in channels}
        kind = kinds.pop() if len(kinds) == 1 else np.dtype(np.float32)
        pixels = np.empty((*channels[0].shape, len(channels)), kind)
        for number, channel in enumerate(channels):
            is_fraction = channel.dtype == np.uint32 and kind == np.float32
            pixels[..., number] = channel / _LARGEST if is_fraction else channel
        return pixels


def write_parts(path: Path, parts: Sequence[Part], thorough: bool = True) -> None:
    """Write an EXR and make sure that all of it is there; OSError otherwise.

    ``thorough``: all of it is read again. Else the last row of each part is, which is enough to see
    that its end was written.
    """
    _write(os.fspath(path), "openexr", parts)
    # OpenImageIO does not report errors at closing.
    if not (_is_whole(path, parts) if thorough else _has_last_rows(path, parts)):
        raise OSError("the end of the file could not be written; is the disk full?")


def encoded(part: Part, suffix: str) -> bytes:
    """A ``.png`` or ``.jpg`` of (height, width, 3) uint8 as bytes. OSError: no room."""
    with _file_with_room(2 * part.pixels.nbytes + 2**16) as path:
        _write(path, suffix[1:].lower(), [part])
        return Path(path).read_bytes()


@contextmanager
def _file_with_room(size: int) -> Iterator[str]:
    """An empty file that can grow so far, in memory where there are such files, as libjpeg ends the
    process where it cannot write."""
    if hasattr(os, "memfd_create"):
        with open(os.memfd_create("view"), "wb") as file:
            os.ftruncate(file.fileno(), size)
            yield f"/proc/self/fd/{file.fileno()}"
    else:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "view"
            path.write_bytes(bytes(size))
            yield os.fspath(path)


def read_parts(path: str | os.PathLike[str]) -> Iterator[tuple[Any, Channels]]:
    """Of each part: OpenImageIO's spec, and the channels as uint32, half or else float32.

    OSError where something cannot be read.
    """
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(os.fspath(path))
    if file is None:
        raise OSError(one_line(oiio.geterror()))
    try:
        number = 0
        while file.seek_subimage(number, 0):
            spec = file.spec()
            yield spec, _read_channels(file, number, spec)
            number += 1
        file.geterror()  # fetched so that it is not printed at exit
    finally:
        file.close()


def png_of(pixels: npt.NDArray[np.uint8]) -> bytes:
    """A PNG's bytes, of (height, width, 3) in sRGB."""
    return encoded(Part(rgb(pixels), {"oiio:ColorSpace": "sRGB"}), ".png")


def rgb(pixels: npt.NDArray[Any]) -> Channels:
    """(height, width, 3) as three channels."""
    return dict(zip("RGB", np.moveaxis(pixels, -1, 0), strict=True))


def one_line(message: str) -> str:
    """OpenImageIO's message without its line breaks and repetitions."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    return lines[0] if lines else "unknown error"


def _read_channels(file: Any, number: int, spec: Any) -> Channels:
    kinds = [str(spec.channelformat(c)) for c in range(spec.nchannels)]
    channels: Channels = {}
    for kind, run in groupby(range(spec.nchannels), key=lambda c: kinds[c]):
        columns = list(run)
        known = kind if kind in ("uint", "half") else "float"
        pixels = file.read_image(number, 0, columns[0], columns[-1] + 1, known)
        if pixels is None:
            raise OSError(one_line(file.geterror()))
        if known == "half":
            pixels = np.asarray(pixels).view(np.float16)
        for c, channel in zip(columns, np.moveaxis(np.asarray(pixels), -1, 0), strict=True):
            channels[spec.channelnames[c]] = channel
    return channels


def _write(path: str, kind: str, parts: Sequence[Part]) -> None:
    """By the writer of that name."""
    import OpenImageIO as oiio

    pixels = [part.pixels for part in parts]
    specs = [
        _spec(part, values.dtype, kind == "openexr")
        for part, values in zip(parts, pixels, strict=True)
    ]
    file = oiio.ImageOutput.create(kind)
    if file is None:
        raise OSError(one_line(oiio.geterror()))
    written = file.open(path, specs if len(specs) > 1 else specs[0])
    for number, (values, spec) in enumerate(zip(pixels, specs, strict=True)):
        if number:
            written = written and file.open(path, spec, "AppendSubimage")
        written = written and file.write_image(values)
    written = file.close() and written
    if not written or file.has_error:
        raise OSError(one_line(file.geterror()))


def _spec(part: Part, kind: np.dtype[Any], exr: bool) -> Any:
    import OpenImageIO as oiio

    height, width = next(iter(part.channels.values())).shape
    spec = oiio.ImageSpec(width, height, len(part.channels), _FORMATS[kind.name])
    spec.channelnames = tuple(part.channels)
    spec.channelformats = tuple(
        oiio.TypeDesc(_FORMATS[channel.dtype.name]) for channel in part.channels.values()
    )
    window = part.data_window
    if window is not None and exr:
        spec.x, spec.y = window["x"], window["y"]
        spec.full_width, spec.full_height = window["full_width"], window["full_height"]
    for name, value in part.attributes.items():
        _set_attribute(spec, name, value)
    return spec


def _is_whole(path: Path, parts: Sequence[Part]) -> bool:
    """Whether all of an EXR is what was written, where its compression has no losses."""
    try:
        again = [channels for _, channels in read_parts(path)]
    except OSError:
        return False
    return len(again) == len(parts) and all(
        part.channels.keys() == channels.keys()
        and (
            str(part.attributes.get("compression", "")).partition(":")[0] in LOSSY
            or all(
                np.array_equal(channels[name], wanted, equal_nan=wanted.dtype.kind == "f")
                for name, wanted in part.channels.items()
            )
        )
        for part, channels in zip(parts, again, strict=True)
    )


def _has_last_rows(path: Path, parts: Sequence[Part]) -> bool:
    """Whether the last row of each part of an EXR is what was written."""
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(os.fspath(path))
    if file is None:
        return False
    try:
        for number, part in enumerate(parts):
            if not file.seek_subimage(number, 0):
                return False
            spec, last = file.spec(), next(iter(part.channels.values())).shape[0] - 1
            y = spec.y + last
            for c, name in enumerate(spec.channelnames):
                wanted = part.channels[name][last]
                kind = _FORMATS[wanted.dtype.name]
                row = file.read_scanlines(number, 0, y, y + 1, 0, c, c + 1, kind)
                if row is None:
                    return False
                row = np.asarray(row)
                row = row.view(np.float16) if kind == "half" else row
                if not np.array_equal(row.ravel(), wanted, equal_nan=wanted.dtype.kind == "f"):
                    return False
        file.geterror()
        return True
    finally:
        file.close()


def _set_attribute(spec: Any, name: str, value: Any) -> None:
    """Set one attribute with a type that the EXR writer keeps."""
    import OpenImageIO as oiio

    if isinstance(value, np.ndarray) and value.shape == (4, 4):
        spec.attribute(name, oiio.TypeDesc("matrix"), tuple(float(v) for v in value.ravel()))
    elif isinstance(value, np.ndarray):
        kind = oiio.TypeDesc(f"float[{value.size}]")
        spec.attribute(name, kind, tuple(float(v) for v in value.ravel()))
    elif isinstance(value, Fraction):
        spec.attribute(name, oiio.TypeDesc("rational"), (value.numerator, value.denominator))
    elif isinstance(value, float):
        spec.attribute(name, value)  # float32: the EXR writer drops doubles
    elif isinstance(value, int) and -(2**31) <= value < 2**31:
        spec.attribute(name, int(value))
    else:
        spec.attribute(name, str(value))
