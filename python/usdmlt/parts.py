"""Parts of renders: the integers that some units gave, in files that are pictures too.

A part file, and so a checkpoint, is an EXR. Its first part is the picture of its units, with all
layers; the others, ``film.NAME``, are the sums of the film as ``uint`` channels, two for each
number: ``N.low`` and ``N.high``, the words of a 64-bit integer in two's complement. The attribute
``usdmlt:part`` of the first is JSON: which units they are, what they counted, and of which plan
they are. After the EXR, which readers of EXR do not look at, comes a checksum of all bytes before
it.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from usdmlt import exr, files
from usdmlt.errors import Error
from usdmlt.fingerprint import Fingerprint
from usdmlt.image import Image
from usdmlt.image_files import Channels, Part, read_parts, write_parts
from usdmlt.layers import Layer
from usdmlt.units import Range, joined

ATTRIBUTE = "part"  # as usdmlt:part
FORMAT = 2
_SEAL = b"usdmlt-sha256:"
_SEAL_SIZE = len(_SEAL) + 64

Sums = Mapping[str, npt.NDArray[np.int64]]


@dataclass(frozen=True)
class State:
    """What some units gave. ``sums``: int64 arrays by name, as the film has them; ``saved``: which
    units they are and what they counted."""

    sums: Sums
    saved: dict[str, Any]

    @property
    def units(self) -> list[Range]:
        """Which they are."""
        return [(int(first), int(last)) for first, last in self.saved["units"]]


def added(a: dict[str, Any], b: dict[str, Any]) -> dict[str, Any]:
    """``saved`` of the units of both, which must not overlap."""
    classes = dict(map(tuple, a["path_classes"]))
    for key, energy in b["path_classes"]:
        classes[key] = classes.get(key, 0) + energy
    return {
        "units": joined([*a["units"], *b["units"]]),
        "statistics": [x + y for x, y in zip(a["statistics"], b["statistics"], strict=True)],
        "metropolis": [x + y for x, y in zip(a["metropolis"], b["metropolis"], strict=True)],
        "path_classes": sorted(classes.items()),
        "longest_rejection": max(a["longest_rejection"], b["longest_rejection"]),
        **{name: a[name] + b[name] for name in ("overflows", "seconds", "cpu_seconds")},
    }


@dataclass(frozen=True)
class RenderPart:
    """A part of a render, as a file has it.

    ``units_total``: of the whole. ``scales``: of the film, of radiance and the weight of samples
    (cpp/film/film.hpp). ``development``: mutations per unit and exposure
    (cpp/film/development.hpp). ``light_layers``: names of the layers that the film has, in its
    order. ``samples_per_unit``: on average. ``making``: how to make the picture again, as
    :class:`usdmlt.making.Making` has it. ``image``: the picture of the units.
    """

    fingerprint: Fingerprint
    state: State
    units_total: int
    scales: tuple[float, float]
    development: tuple[int, float]
    light_layers: tuple[str, ...]
    samples_per_unit: float
    making: dict[str, Any] | None
    image: Image


@dataclass(frozen=True)
class _SumsPart(Part):
    """Of (height, width, numbers) int64, whose words are the channels."""

    words: npt.NDArray[np.uint32] | None = None

    @property
    def pixels(self) -> npt.NDArray[Any]:
        assert self.words is not None
        return self.words


def write(
    path: str | os.PathLike[str],
    part: RenderPart,
    compression: str = "zip",
    before: Callable[[Path], None] | None = None,
) -> None:
    """Write a part, whole or not at all, and onto the disk; :class:`usdmlt.Error` otherwise.

    ``compression``: as of :class:`usdmlt.exr.Format`; "zip" takes the place of those with losses.
    ``before`` is called with the path just before the file there is replaced.
    """
    image = part.image
    if exr.Format(compression).lossy:
        compression = "zip"
    pictures = exr.parts(image, exr.Format(compression, pixel_type="float"))
    header = {
        "format": FORMAT,
        "fingerprint": part.fingerprint,
        "saved": part.state.saved,
        "units_total": part.units_total,
        "scales": part.scales,
        "development": part.development,
        "light_layers": part.light_layers,
        "samples_per_unit": part.samples_per_unit,
        "making": part.making,
        "layers": {name: asdict(image.layer(name)) for name in image.channels},
    }
    first = pictures[0].attributes
    first[f"usdmlt:{ATTRIBUTE}"] = json.dumps(header)
    first["oiio:subimagename"] = exr.FIRST_PART
    shared = {name: first[name] for name in exr.SHARED if name in first}
    sums = [
        _part_of_sums(name, plane, shared | {"compression": compression}, pictures[0].data_window)
        for name, plane in part.state.sums.items()
    ]
    with files.replacing(path, durable=True, before=before) as temporary:
        write_parts(temporary, [*pictures, *sums], thorough=False)
        _seal(temporary)


def read(path: str | os.PathLike[str]) -> RenderPart:
    """Read a part; :class:`usdmlt.Error` where it is damaged, or none."""
    _check_seal(path)
    try:
        found = list(read_parts(path))
        spec, planes = found[0][0], {}
        header = json.loads(spec.get_string_attribute(f"usdmlt:{ATTRIBUTE}"))
        if header["format"] != FORMAT:
            raise Error(f"{path} is a part of another version of usdmlt")
        pictures = []
        for part_spec, channels in found:
            name = part_spec.get_string_attribute("oiio:subimagename")
            if name.startswith(exr.SUMS_PREFIX):
                planes[name.removeprefix(exr.SUMS_PREFIX)] = channels
            else:
                pictures.append((part_spec, channels))
        layers = {name: Layer(**layer) for name, layer in header["layers"].items()}
        shown = exr.merged(pictures)
        image = Image(
            {name: _array(layer, shown) for name, layer in layers.items()},
            color_space=spec.get_string_attribute("colorInteropID"),
            metadata=_metadata(spec),
            layers=layers,
        )
        lights = tuple(header["light_layers"])
        sums = {name: _sums(name, channels, len(lights)) for name, channels in planes.items()}
        scale, sample_weight = header["scales"]
        mutations, exposure = header["development"]
        return RenderPart(
            header["fingerprint"],
            State(sums, header["saved"]),
            header["units_total"],
            (scale, sample_weight),
            (mutations, exposure),
            lights,
            header["samples_per_unit"],
            header["making"],
            image,
        )
    except OSError as error:
        raise Error(f"cannot read {path}: {error}") from None
    except (KeyError, TypeError, ValueError) as error:
        raise Error(f"cannot read {path}: it is no part of a render ({error})") from None


def _part_of_sums(
    name: str,
    plane: npt.NDArray[np.int64],
    attributes: dict[str, Any],
    window: dict[str, int] | None,
) -> Part:
    """What a pixel has are numbers side by side."""
    height, width = plane.shape[:2]
    columns = np.ascontiguousarray(plane).reshape(height, width, -1)
    words = columns.astype("<i8", copy=False).view("<u4")
    channels = {
        f"{number:03}.{word}": words[..., 2 * number + half]
        for number in range(columns.shape[2])
        for half, word in enumerate(("low", "high"))
    }
    attributes = attributes | {"oiio:subimagename": exr.SUMS_PREFIX + name}
    return _SumsPart(channels, attributes, window, words)


def _sums(name: str, channels: Channels, lights: int) -> npt.NDArray[np.int64]:
    numbers = len(channels) // 2
    height, width = next(iter(channels.values())).shape
    words = np.empty((height, width, 2 * numbers), "<u4")
    for number in range(numbers):
        for half, word in enumerate(("low", "high")):
            words[..., 2 * number + half] = channels[f"{number:03}.{word}"]
    plane = words.view("<i8").astype(np.int64, copy=False)
    if name.endswith("squares"):
        return plane[..., 0]
    return plane.reshape(height, width, lights, 3) if name == "layers" else plane


def _metadata(spec: Any) -> dict[str, Any]:
    """As :attr:`Image.metadata` has it, matrices as arrays, so that they are written as such."""
    return {
        name: np.reshape(value, (4, 4)) if isinstance(value, tuple) and len(value) == 16 else value
        for name, value in exr.read_metadata(spec).items()
    }


def _array(layer: Layer, channels: Channels) -> npt.NDArray[Any]:
    """A layer of a picture, of its channels; those of a part of its own may go by its name."""
    columns = [
        channels[name if name in channels else f"{layer.stem}.{name}"] for name in layer.channels
    ]
    pixels = columns[0] if len(columns) == 1 else np.stack(columns, axis=-1)
    return pixels.astype(layer.dtype)


def _digest(path: str | os.PathLike[str], size: int) -> bytes:
    """Of the first ``size`` bytes, as hexadecimal digits."""
    digest = hashlib.sha256()
    buffer = memoryview(bytearray(1 << 20))
    with open(path, "rb", buffering=0) as file:
        while size > 0:
            count = file.readinto(buffer[: min(size, len(buffer))])
            if not count:
                raise OSError("it ends too early")
            digest.update(buffer[:count])
            size -= count
    return digest.hexdigest().encode()


def _seal(path: Path) -> None:
    digest = _digest(path, path.stat().st_size)
    with open(path, "ab") as file:
        file.write(_SEAL + digest)


def _check_seal(path: str | os.PathLike[str]) -> None:
    """Raise :class:`usdmlt.Error` unless the checksum is there and right."""
    try:
        size = os.stat(path).st_size
        if size <= _SEAL_SIZE:
            raise Error(f"cannot read {path}: it is damaged, or no part of a render")
        with open(path, "rb") as file:
            is_exr = file.read(4) == b"\x76\x2f\x31\x01"
            file.seek(size - _SEAL_SIZE)
            seal = file.read()
        if not seal.startswith(_SEAL):
            reason = "it ends too early, or is a picture only" if is_exr else "it is no EXR"
            raise Error(f"cannot read {path}: {reason}, and no part of a render")
        if _digest(path, size - _SEAL_SIZE) != seal.removeprefix(_SEAL):
            raise Error(f"cannot read {path}: it is damaged, its checksum is another")
    except OSError as error:
        raise Error(f"cannot read {path}: {error.strerror or error}") from None
