"""Pictures: named layers of numbers, and their files.

EXR is the picture itself: linear, premultiplied, with its layers (:mod:`usdmlt.exr`). PNG and JPEG
are views of it for looking at (:mod:`usdmlt.views`).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from usdmlt import color, exr, files, views
from usdmlt.errors import UsageError
from usdmlt.image_files import Part, encoded, png_of, rgb, write_parts
from usdmlt.layers import Layer
from usdmlt.layers import of as layer_of

EXTENSIONS = (".exr", ".png", ".jpg", ".jpeg")


@dataclass(repr=False)
class Image:
    """A rendered picture.

    ``channels``: layers by name, float32 or, of ids and counts, uint32: ``"color"``
    (height, width, 3), linear in ``color_space`` and premultiplied by coverage, ``"alpha"``
    (height, width), where it was estimated ``"error"`` (height, width), the standard error of the
    luminance of ``"color"``, and the layers that were asked for.
    Row 0 is the top. ``image["color"]`` is short for ``image.channels["color"]``.
    ``stats``: what the render measured. ``metadata``: what the file says about its making
    (renderer, stage, camera, frame, seed, samples, seconds ...): strings, numbers, 4x4 arrays; and
    ``"data_window"`` of a part of a picture: its x, y, full_width and full_height. ``layers``: what
    those of ``channels`` are that :func:`usdmlt.layers.of` does not tell by name and shape.

    In a notebook it shows itself.
    """

    channels: dict[str, npt.NDArray[Any]]
    color_space: str = color.DEFAULT
    stats: dict[str, Any] = field(default_factory=dict)
    metadata: dict[str, Any] = field(default_factory=dict)
    layers: dict[str, Layer] = field(default_factory=dict)

    @classmethod
    def from_rgba(cls, rgba: npt.NDArray[np.float32], **attributes: Any) -> Image:
        """From one (height, width, 4) array; ``attributes`` are the other fields."""
        rgba = np.asarray(rgba, dtype=np.float32)
        return cls({"color": rgba[..., :3], "alpha": rgba[..., 3]}, **attributes)

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self.channels[name]

    def __repr__(self) -> str:
        return f"<{self.width}x{self.height} {self.color_space}: {', '.join(self.channels)}>"

    def layer(self, name: str) -> Layer:
        """What one of ``channels`` is."""
        return self.layers.get(name) or layer_of(name, self.channels[name])

    @property
    def height(self) -> int:
        """Rows."""
        return int(self["color"].shape[0])

    @property
    def width(self) -> int:
        """Columns."""
        return int(self["color"].shape[1])

    def write(self, path: str | os.PathLike[str], view: str = "sRGB", **how: Any) -> None:
        """Write ``.exr``, ``.png`` or ``.jpg``, whole or not at all.

        The EXR holds colours as half floats; what is beyond their range is clamped to ±65504 and
        counted in a warning. ``how``: the fields of :class:`usdmlt.exr.Format`: ``compression``
        ("zip"), ``pixel_type`` ("half" or "float"), ``multipart`` (False). A part of a picture has
        the whole one as the EXR's display window.
        The others are an opaque ``view`` of it: "sRGB", the linear values ("disabled"), or one of
        OpenColorIO's (:mod:`usdmlt.views`).
        Raises ValueError for another extension, format or view and :class:`usdmlt.Error` when the
        file cannot be written; an existing file of that name is then as it was.
        """
        target, how_exr = check_extension(path), exr.Format(**how)
        if target.suffix.lower() == ".exr":
            parts = exr.parts(self, how_exr)
            with files.replacing(target) as temporary:
                write_parts(temporary, parts)
        else:
            shown = self._view(view)
            with files.replacing(target) as temporary:
                temporary.write_bytes(encoded(shown, target.suffix))

    def png(self, view: str = "sRGB") -> bytes:
        """A PNG of the view, as bytes."""
        return png_of(views.encode(self["color"], self.color_space, view))

    def _repr_png_(self) -> bytes:
        return self.png()

    def _view(self, view: str) -> Part:
        attributes: dict[str, Any] = {"Compression": "jpeg:95", "jpeg:subsampling": "4:4:4"}
        if view == "disabled":
            attributes["oiio:ColorSpace"] = self.color_space
        elif views.find(view).display.startswith("sRGB"):
            attributes["oiio:ColorSpace"] = "sRGB"
        if "renderer" in self.metadata:
            attributes["Software"] = self.metadata["renderer"]
        return Part(rgb(views.encode(self["color"], self.color_space, view)), attributes)


def read(path: str | os.PathLike[str]) -> Image:
    """Read an EXR that usdmlt wrote, or any other with channels R, G, B.

    All layers of all parts of the same size come along. Raises :class:`usdmlt.Error` when it is
    missing, unreadable or lacks those channels.
    """
    channels, color_space, metadata = exr.read(path)
    return Image(channels, color_space=color_space, metadata=metadata)


def check_extension(path: str | os.PathLike[str]) -> Path:
    """The path, if its extension is one that can be written; ValueError otherwise."""
    target = Path(path)
    if target.suffix.lower() not in EXTENSIONS:
        known = ", ".join(EXTENSIONS[:-1]) + " or " + EXTENSIONS[-1]
        raise UsageError(f"{target}: the output's extension has to be {known}")
    return target
