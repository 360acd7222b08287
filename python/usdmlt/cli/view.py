"""The flags that say what of a stage is read: shared by `render` and `inspect`."""

from __future__ import annotations

import argparse
from typing import Any

from usdmlt.settings import check_resolution


def add_view_flags(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Declare STAGE and the flags, named as usdrecord's where it has them."""
    parser.add_argument("stage", metavar="STAGE", help=".usd, .usda, .usdc or .usdz file")
    view = parser.add_argument_group("what is read")
    view.add_argument(
        "--camera",
        "-cam",
        metavar="PRIM",
        help="camera prim, path or name (default: that of the render settings, else main_cam, "
        "else the only camera, else one that frames everything)",
    )
    size = view.add_mutually_exclusive_group()
    size.add_argument(
        "--imageWidth",
        "-w",
        metavar="N",
        type=int,
        help="width in pixels; the height follows from the camera "
        "(default: the size in the render settings, else 960 wide)",
    )
    size.add_argument(
        "--res", metavar=("W", "H"), nargs=2, type=int, help="width and height in pixels"
    )
    view.add_argument(
        "--purposes",
        metavar="P[,P]",
        help="purposes to render besides `default` "
        "(default: those of the render settings, else render)",
    )
    view.add_argument(
        "--mask", metavar="PRIM[,PRIM]", help="read only these prims and what is below them"
    )
    view.add_argument("--sessionLayer", metavar="FILE", help="layer with the strongest opinions")
    view.add_argument(
        "--colorSpace",
        metavar="NAME",
        default="lin_rec709_scene",
        help="linear RGB space of the rendering and the picture, such as lin_ap1_scene for "
        "ACEScg (default: %(default)s)",
    )
    return view


def load_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The flags as options of :func:`usdmlt.load`; ValueError for what they cannot be."""
    from usdmlt.color import rendering_space

    width, height = arguments.res or (arguments.imageWidth, None)
    check_resolution(width, height)
    rendering_space(arguments.colorSpace)
    return {
        "camera": arguments.camera,
        "width": width,
        "height": height,
        "purposes": _split(arguments.purposes),
        "mask": _split(arguments.mask),
        "session_layer": arguments.sessionLayer,
        "color_space": arguments.colorSpace,
    }


def _split(names: str | None) -> tuple[str, ...] | None:
    return None if names is None else tuple(names.replace(",", " ").split())
