"""Pictures: named layers of floats, and their files.

EXR is the picture itself: linear, half RGBA, premultiplied, and the error of its luminance as a
layer of floats. PNG is a view of it for looking at.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from usdmlt import color, files
from usdmlt.errors import Error, UsageError
from usdmlt.options import View

logger = logging.getLogger("usdmlt")

EXTENSIONS = (".exr", ".png")
HALF_MAX = 65504.0
# Channel C of layer L is named L.C in an EXR. Floats: errors are small, and half stops at 6e-8.
ERROR_CHANNEL = "error.Y"

# Attributes that EXR and OpenImageIO define; everything else is written as usdmlt:NAME.
_STANDARD_ATTRIBUTES = frozenset(
    {"renderer", "Software", "worldToCamera", "worldToNDC", "comments", "FramesPerSecond"}
)
# Arrays of (height, width) by the name they have in the file, in its order.
_Channels = dict[str, npt.NDArray[Any]]
_FORMATS = {"float16": "half", "float32": "float", "uint8": "uint8"}  # as OpenImageIO names them
_PNG_END = b"\x00\x00\x00\x00IEND\xaeB`\x82"


@dataclass
class Image:
    """A rendered picture.

    ``channels``: float32 layers by name: ``"color"`` (height, width, 3), linear in
    ``color_space`` and premultiplied by coverage, ``"alpha"`` (height, width), and where it was
    estimated ``"error"`` (height, width), the standard error of the luminance of ``"color"``.
    Row 0 is the top. ``image["color"]`` is short for ``image.channels["color"]``.
    ``stats``: what the render measured. ``metadata``: what the file says about its making
    (renderer, stage, camera, frame, seed, samples, seconds ...): strings, numbers, 4x4 arrays; and
    ``"data_window"`` of a part of a picture: its x, y, full_width and full_height.
    """

    channels: dict[str, npt.NDArray[np.float32]]
    color_space: str = color.DEFAULT
    stats: dict[str, Any] = field(default_factory=dict)
    metadata: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def from_rgba(cls, rgba: npt.NDArray[np.float32], **attributes: Any) -> Image:
        """From one (height, width, 4) array; ``attributes`` are the other fields."""
        rgba = np.asarray(rgba, dtype=np.float32)
        return cls({"color": rgba[..., :3], "alpha": rgba[..., 3]}, **attributes)

    def __getitem__(self, name: str) -> npt.NDArray[np.float32]:
        return self.channels[name]

    @property
    def height(self) -> int:
        """Rows."""
        return int(self["color"].shape[0])

    @property
    def width(self) -> int:
        """Columns."""
        return int(self["color"].shape[1])

    def write(self, path: str | os.PathLike[str], view: View = "sRGB") -> None:
        """Write ``.exr`` or ``.png``, whole or not at all.

        The EXR holds half floats; what is beyond their range is clamped to ±65504 and counted in a
        warning. The error is its channel ``error.Y``, of floats. The PNG is the sRGB view
        (:func:`usdmlt.color.srgb_view`), opaque, and has no error; with ``view="disabled"`` it is
        the linear values, clipped to 0 and 1. A part of a picture has the whole one as the EXR's
        display window.
        Raises ValueError for another extension and :class:`usdmlt.Error` when the file cannot be
        written; an existing file of that name is then as it was.
        """
        target = check_extension(path)
        exr = target.suffix.lower() == ".exr"
        part = self.exr_part() if exr else Part(*self._png(view))
        with files.replacing(target) as temporary:
            write_parts(temporary, [part])

    def exr_part(self) -> Part:
        """What an EXR of this picture holds."""
        rgba = np.concatenate([self["color"], self["alpha"][..., None]], axis=-1)
        beyond = int(np.count_nonzero(np.abs(rgba) > HALF_MAX))
        if beyond:
            logger.warning(
                "%d value%s beyond the range of half floats %s clamped to 65504",
                beyond,
                "s" if beyond > 1 else "",
                "were" if beyond > 1 else "was",
            )
        attributes: dict[str, Any] = {
            "compression": "zip",
            "oiio:ColorSpace": self.color_space,
            "colorInteropID": self.color_space,
            "chromaticities": np.array(
                color.rendering_space(self.color_space).chromaticities.flat(), np.float32
            ),
        }
        for name, value in self.metadata.items():
            if value is not None and name != "data_window":
                attributes[name if name in _STANDARD_ATTRIBUTES else f"usdmlt:{name}"] = value
        rgba = np.clip(rgba, -HALF_MAX, HALF_MAX).astype(np.float16)
        channels = dict(zip("RGBA", np.moveaxis(rgba, -1, 0), strict=True))
        if "error" in self.channels:
            channels[ERROR_CHANNEL] = self["error"].astype(np.float32)
        return Part(channels, attributes, self.metadata.get("data_window"))

    def _png(self, view: View) -> tuple[_Channels, dict[str, Any]]:
        attributes = {"oiio:ColorSpace": "sRGB" if view == "sRGB" else self.color_space}
        if "renderer" in self.metadata:
            attributes["Software"] = self.metadata["renderer"]
        if view == "sRGB":
            pixels = color.srgb_view(self["color"], self.color_space)
        else:
            linear = np.nan_to_num(self["color"], nan=0.0)
            pixels = np.rint(255 * np.clip(linear, 0, 1)).astype(np.uint8)
        return _rgb(pixels), attributes


def read(path: str | os.PathLike[str]) -> Image:
    """Read an EXR that usdmlt wrote, or any other with channels R, G, B and perhaps A, error.Y.

    Raises :class:`usdmlt.Error` when it is missing, unreadable or lacks those channels.
    """
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(os.fspath(path))
    if file is None:
        raise Error(f"cannot read {path}: {_one_line(oiio.geterror())}")
    spec = file.spec()
    pixels = file.read_image("float")
    file.close()
    if pixels is None:
        raise Error(f"cannot read {path}: {_one_line(file.geterror())}")
    names = list(spec.channelnames)
    if not {"R", "G", "B"} <= set(names):
        raise Error(f"cannot read {path}: it has no channels R, G, B but {', '.join(names)}")
    rgb = pixels[..., [names.index(c) for c in "RGB"]]
    alpha = pixels[..., names.index("A")] if "A" in names else np.ones_like(rgb[..., 0])
    channels = {"color": rgb, "alpha": alpha}
    if ERROR_CHANNEL in names:
        channels["error"] = pixels[..., names.index(ERROR_CHANNEL)]
    metadata = {
        a.name.removeprefix("usdmlt:"): a.value
        for a in spec.extra_attribs
        if a.name.startswith("usdmlt:") or a.name in _STANDARD_ATTRIBUTES
    }
    # OpenImageIO before 3.1 renames what it finds in oiio:ColorSpace.
    color_space = spec.get_string_attribute("colorInteropID", color.DEFAULT)
    return Image(channels, color_space=color_space, metadata=metadata)


def check_extension(path: str | os.PathLike[str]) -> Path:
    """The path, if its extension is one that can be written; ValueError otherwise."""
    target = Path(path)
    if target.suffix.lower() not in EXTENSIONS:
        known = " or ".join(EXTENSIONS)
        raise UsageError(f"{target}: the output's extension has to be {known}")
    return target


@dataclass(frozen=True)
class Part:
    """Of a file: channels in its order, attributes, and where the pixels are in the whole picture.

    Only an EXR can have several; their attribute ``oiio:subimagename`` tells them apart.
    """

    channels: _Channels
    attributes: dict[str, Any]
    data_window: dict[str, int] | None = None

    @property
    def pixels(self) -> npt.NDArray[Any]:
        """(height, width, channels)."""
        return np.stack(list(self.channels.values()), axis=-1)


def write_parts(path: Path, parts: Sequence[Part]) -> None:
    """Write the file and make sure that all of it is there; OSError otherwise."""
    import OpenImageIO as oiio

    specs = [_spec(part, path.suffix.lower() == ".exr") for part in parts]
    file = oiio.ImageOutput.create(os.fspath(path))
    if file is None:
        raise OSError(_one_line(oiio.geterror()))
    written = file.open(os.fspath(path), specs if len(specs) > 1 else specs[0])
    for number, (part, spec) in enumerate(zip(parts, specs, strict=True)):
        if number:
            written = written and file.open(os.fspath(path), spec, "AppendSubimage")
        written = written and file.write_image(part.pixels)
    written = file.close() and written
    if not written or file.has_error:
        raise OSError(_one_line(file.geterror()))
    if not _is_whole(path, parts):
        raise OSError("the end of the file could not be written; is the disk full?")


def png_of(pixels: npt.NDArray[np.uint8]) -> bytes:
    """A PNG's bytes, of (height, width, 3) in sRGB. OSError as of :func:`write_parts`."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "view.png"
        write_parts(path, [Part(_rgb(pixels), {"oiio:ColorSpace": "sRGB"})])
        return path.read_bytes()


def _rgb(pixels: npt.NDArray[np.uint8]) -> _Channels:
    return dict(zip("RGB", np.moveaxis(pixels, -1, 0), strict=True))


def _spec(part: Part, exr: bool) -> Any:
    import OpenImageIO as oiio

    pixels = part.pixels
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, _FORMATS[pixels.dtype.name])
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
    """Whether the file's end reached the disk: OpenImageIO does not report errors at closing."""
    import OpenImageIO as oiio

    if path.suffix.lower() == ".png":
        with open(path, "rb") as png:
            png.seek(-len(_PNG_END), os.SEEK_END)
            return png.read() == _PNG_END
    file = oiio.ImageInput.open(os.fspath(path))
    if file is None:
        oiio.geterror()  # fetched so that it is not printed at exit
        return False
    whole = True
    for number, part in enumerate(parts):
        pixels = part.pixels
        count = pixels.shape[-1]
        again = file.read_image(number, 0, 0, count, _FORMATS[pixels.dtype.name])
        whole = whole and again is not None and np.array_equal(again, pixels, equal_nan=True)
    file.geterror()
    file.close()
    return whole


def _set_attribute(spec: Any, name: str, value: Any) -> None:
    """Set one attribute with a type that the EXR writer keeps."""
    import OpenImageIO as oiio

    if isinstance(value, np.ndarray) and value.shape == (4, 4):
        spec.attribute(name, oiio.TypeDesc("matrix"), tuple(float(v) for v in value.ravel()))
    elif isinstance(value, np.ndarray):
        kind = oiio.TypeDesc(f"float[{value.size}]")
        spec.attribute(name, kind, tuple(float(v) for v in value.ravel()))
    elif isinstance(value, float):
        spec.attribute(name, value)  # float32: the EXR writer drops doubles
    elif isinstance(value, int) and -(2**31) <= value < 2**31:
        spec.attribute(name, int(value))
    else:
        spec.attribute(name, str(value))


def _one_line(message: str) -> str:
    """OpenImageIO's message without its line breaks and repetitions."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    return lines[0] if lines else "unknown error"
