"""The flags that say how pictures are written and looked at, and what they lead to."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from usdmlt.errors import Error, UsageError

if TYPE_CHECKING:
    from usdmlt.display import Display
    from usdmlt.image import Image
    from usdmlt.layers import Layer
    from usdmlt.previews import Preview

logger = logging.getLogger("usdmlt")

DISPLAY_SECONDS = 2.0
COLOR_CORRECTION_MODES = ("disabled", "sRGB", "openColorIO")


def add_writing_flags(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Declare what is written."""
    written = parser.add_argument_group("what is written")
    views = written.add_mutually_exclusive_group()
    views.add_argument(
        "--colorCorrectionMode",
        "-color",
        choices=COLOR_CORRECTION_MODES,
        default="sRGB",
        help="of a .png or .jpg: sRGB, OpenColorIO's default view, or linear values "
        "(default: %(default)s); an .exr is always linear",
    )
    views.add_argument(
        "--view",
        metavar="NAME",
        help="view of a .png or .jpg by OpenColorIO, such as ACES, or DISPLAY/VIEW; of the "
        "configuration in $OCIO, else the built-in one",
    )
    written.add_argument(
        "--aov",
        action="append",
        metavar="LAYER[,LAYER]",
        help="further layers of an .exr: albedo, N, P, Z, CryptoObject ..., primvars:NAME, "
        "lightGroups, direct, indirect, caustics ..., or a light path expression, NAME=LS+DE "
        "(default: the render vars of the product)",
    )
    written.add_argument(
        "--compression",
        metavar="NAME[:LEVEL]",
        default="zip",
        help="of an .exr: none, rle, zip, zips, piz, and with losses pxr24, b44, b44a, dwaa, dwab "
        "(default: %(default)s)",
    )
    written.add_argument(
        "--pixel-type",
        choices=("half", "float"),
        default="half",
        help="of an .exr's colours and directions; distances, errors and so on are float always "
        "(default: %(default)s)",
    )
    written.add_argument(
        "--multipart", action="store_true", help="write each layer as an EXR part of its own"
    )
    written.add_argument(
        "--skip-existing", action="store_true", help="leave out frames whose file is there already"
    )
    return written


def add_looking_flags(parser: argparse.ArgumentParser) -> None:
    """Declare what is to be seen while it renders."""
    looking = parser.add_argument_group("looking at it while it renders")
    looking.add_argument(
        "--snapshot",
        metavar="SECONDS",
        type=float,
        help="write the picture so far that often, to NAME_snapshot.EXT beside OUTPUT, which is "
        "removed when OUTPUT is there",
    )
    looking.add_argument(
        "--display",
        metavar="HOST:PORT",
        help="show the picture so far in the viewer tev, which listens on port 14158",
    )


class Pictures:
    """The flags, checked before anything is rendered, and the connection to a display."""

    def __init__(self, arguments: argparse.Namespace, outputs: list[str]) -> None:
        import numpy as np

        from usdmlt import exr, views

        self.view: str = arguments.view or arguments.colorCorrectionMode
        self.how: dict[str, Any] = {
            "compression": arguments.compression,
            "pixel_type": arguments.pixel_type,
            "multipart": arguments.multipart,
        }
        self._format = exr.Format(**self.how)
        suffixes = {Path(output).suffix.lower() for output in outputs}
        has_views = bool(suffixes - {".exr"})
        if arguments.view and not has_views:
            raise UsageError("--view is of a .png or .jpg: an .exr is linear, and has none")
        if arguments.aov and ".exr" not in suffixes and not arguments.display:
            raise UsageError("--aov is of an .exr: a .png or .jpg has no further layers")
        if has_views:
            views.encode(np.zeros((1, 1, 3)), view=self.view)  # now, not when all is rendered
        self.snapshot_seconds: float | None = arguments.snapshot
        if self.snapshot_seconds is not None and not self.snapshot_seconds > 0:
            raise UsageError(f"--snapshot {self.snapshot_seconds:g} is no time between pictures")
        self._display: Display | None = None
        if arguments.display is not None:
            from usdmlt.display import Display

            self._display = Display(arguments.display)

    def check_layers(self, asked: Iterable[Layer], output: str) -> None:
        """Raise ValueError for layers that the file could not hold."""
        from usdmlt import exr

        if Path(output).suffix.lower() == ".exr" and not self._format.multipart:
            exr.check_compression(self._format, asked)

    def write(self, image: Image, output: str) -> None:
        """Write the picture; show it a last time."""
        image.write(output, self.view, **self.how)
        try:
            self._show(image, output)
        except Error as error:
            logger.warning("%s", error)

    @contextmanager
    def previews(self, output: str) -> Iterator[list[Preview]]:
        """What is shown while one picture renders. The snapshot is removed if all goes well."""
        from usdmlt.previews import Preview

        shown = []
        snapshot = snapshot_path(output)
        if self.snapshot_seconds is not None:
            shown.append(
                Preview(lambda x: x.write(snapshot, self.view, **self.how), self.snapshot_seconds)
            )
        if self._display is not None:
            shown.append(Preview(lambda image: self._show(image, output), DISPLAY_SECONDS))
        yield shown
        if self.snapshot_seconds is not None:
            snapshot.unlink(missing_ok=True)

    def _show(self, image: Image, output: str) -> None:
        """On the display, under the file's name; one that fails is let go of."""
        if self._display is None:
            return
        try:
            self._display.show(Path(output).name, image)
        except Error:
            self._display = None
            raise


def snapshot_path(output: str) -> Path:
    """``shot_snapshot.0101.exr`` of ``shot.0101.exr``: a sequence does not take it for a frame."""
    path = Path(output)
    stem, dot, number = path.stem.rpartition(".")
    name = f"{stem}_snapshot.{number}" if dot else f"{number}_snapshot"
    return path.with_name(name + path.suffix)
