"""Reference pictures: EXR files that know how noisy they are, and how they were made.

The first part is the picture as :meth:`usdmlt.Image.write` writes it. The last, ``batches``, has
the independent batches it is the mean of, as half floats: channel ``03.R`` is red of the fourth.
Its pixels are means over ``usdmlt:cell`` pixels squared, divided by ``usdmlt:scale``.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from usdmlt import exr, files, image
from usdmlt.errors import Error
from usdmlt.image_files import Part, write_parts
from usdmlt.testing.batches import Batches, means
from usdmlt.testing.cells import LUMINANCE

CELL = 2
PART = exr.STATISTICS_PART
CHANNELS = "RGBA"


def write(path: str | os.PathLike[str], batches: Batches, cell: int = CELL) -> None:
    """Write a reference, whole or not at all; :class:`usdmlt.Error` where that fails.

    ``cell``: pixels across of a cell of the batches: 1 finds the least, 4 makes small files.
    """
    size = cell // batches.cell
    scale = _scale(batches.pictures)
    stored = rounded(means(batches.pictures, size), scale) / np.float32(scale)
    channels = {
        f"{k:02}.{name}": picture[..., c].astype(np.float16)
        for k, picture in enumerate(stored)
        for c, name in enumerate(CHANNELS)
    }
    first, *ids = exr.parts(replace(batches, metadata=_portable(batches.metadata, path)))
    first.attributes["oiio:subimagename"] = exr.FIRST_PART
    attributes = {name: first.attributes[name] for name in exr.SHARED if name in first.attributes}
    attributes |= {
        "oiio:subimagename": PART,
        "compression": "zip",
        "usdmlt:cell": cell,
        "usdmlt:scale": float(scale),
        "usdmlt:bits": batches.bits,
        "usdmlt:made": json.dumps(batches.made, sort_keys=True, default=str),
    }
    whole = {"x": 0, "y": 0, "full_width": batches.width, "full_height": batches.height}
    window = first.data_window or whole  # and this one
    with files.replacing(path) as temporary:
        write_parts(temporary, [first, *ids, Part(channels, attributes, window)])


def _portable(metadata: dict[str, Any], path: str | os.PathLike[str]) -> dict[str, Any]:
    """With the stage's path from the reference's folder, as both move with a repository."""
    stage = str(metadata.get("stage") or "")
    if not os.path.isabs(stage):
        return metadata
    folder = os.path.dirname(os.path.realpath(path))
    try:
        return metadata | {"stage": Path(os.path.relpath(stage, folder)).as_posix()}
    except ValueError:  # on another drive
        return metadata


def read(path: str | os.PathLike[str]) -> Batches:
    """Read a reference; :class:`usdmlt.Error` where it is missing, unreadable or none."""
    picture = image.read(path)
    reference = read_batches(path, picture)
    if reference is None:
        raise Error(f"cannot read {path}: it has no batches, so it is no reference")
    return reference


def read_batches(path: str | os.PathLike[str], picture: image.Image) -> Batches | None:
    """The batches of a file whose picture was read already, if it has any."""
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(os.fspath(path))
    if file is None:
        raise Error(f"cannot read {path}: {oiio.geterror().strip()}")
    try:
        number = 1
        while True:
            spec = file.spec(number)
            if not spec.nchannels:
                file.geterror()
                return None
            if spec.get_string_attribute("oiio:subimagename") == PART:
                break
            number += 1
        pixels = file.read_image(number, 0, 0, spec.nchannels, "float")
        if pixels is None:
            raise Error(f"cannot read {path}: {file.geterror().strip()}")
    finally:
        file.close()
    count = spec.nchannels // len(CHANNELS)
    wanted = [f"{k:02}.{name}" for k in range(count) for name in CHANNELS]
    names = list(spec.channelnames)
    cell, made = spec.get_int_attribute("usdmlt:cell"), spec.get_string_attribute("usdmlt:made")
    if sorted(names) != sorted(wanted) or cell < 1 or not made:
        raise Error(f"cannot read {path}: its batches are not as usdmlt writes them")
    try:
        made = json.loads(made)
    except ValueError:
        raise Error(f"cannot read {path}: what it says of its making is no JSON") from None
    scale = float(spec.get_float_attribute("usdmlt:scale", 1.0))
    stored = pixels[..., [names.index(name) for name in wanted]]
    stored = stored.reshape(*stored.shape[:2], count, len(CHANNELS)).transpose(2, 0, 1, 3)
    return Batches(
        channels=picture.channels,
        color_space=picture.color_space,
        metadata=picture.metadata,
        pictures=np.ascontiguousarray(stored) * np.float32(scale),
        cell=cell,
        made=made,
        bits=spec.get_string_attribute("usdmlt:bits"),
        scale=scale,
    )


def comparable(batches: Batches, reference: Batches) -> npt.NDArray[np.float32]:
    """The batches' pictures as a file would hold them beside those of the reference."""
    size = max(reference.cell // batches.cell, 1)
    return rounded(means(batches.pictures, size), reference.scale)


def rounded(pictures: npt.NDArray[np.float32], scale: float) -> npt.NDArray[np.float32]:
    """To half floats of this scale; what is beyond their range is cut."""
    half = np.clip(pictures / np.float32(scale), -exr.HALF_MAX, exr.HALF_MAX)
    return np.asarray(half.astype(np.float16) * np.float32(scale), np.float32)


def _scale(pictures: npt.NDArray[np.float32]) -> float:
    """A power of two near the mean luminance, so that neither end of halves is close."""
    mean = float(np.mean(pictures[..., :3].astype(np.float64) @ LUMINANCE))
    return float(2.0 ** np.round(np.log2(mean))) if 0 < mean < np.inf else 1.0
