"""The flags that say what of a stage is read: shared by `render` and `inspect`."""

from __future__ import annotations

import argparse
from typing import Any, get_args

from usdmlt.errors import UsageError
from usdmlt.options import Complexity, DoubleSided, ResolverContext
from usdmlt.settings import check_resolution


def add_view_flags(
    parser: argparse.ArgumentParser, stage_is_needed: bool = True
) -> argparse._ArgumentGroup:
    """Declare STAGE and the flags, named as usdrecord's where it has them."""
    parser.add_argument(
        "stage",
        metavar="STAGE",
        nargs=None if stage_is_needed else "?",
        help=".usd, .usda, .usdc or .usdz file",
    )
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
        "--crop",
        metavar=("XMIN", "YMIN", "XMAX", "YMAX"),
        nargs=4,
        type=float,
        help="render a part of the picture only: from 0 0, the lower left corner, to 1 1 "
        "(default: the render settings' dataWindowNDC)",
    )
    view.add_argument(
        "--purposes",
        metavar="P[,P]",
        help="purposes to render besides `default` "
        "(default: those of the render settings, else render)",
    )
    view.add_argument(
        "--complexity",
        "-c",
        choices=get_args(Complexity),
        help="how finely curved surfaces are subdivided (default: as finely as the picture shows)",
    )
    view.add_argument(
        "--double-sided",
        choices=get_args(DoubleSided),
        help="auto: surfaces without doubleSided are seen, and shade, from their front alone "
        "(default: what usdmlt:doubleSided of the render settings says, else on)",
    )
    settings = view.add_mutually_exclusive_group()
    settings.add_argument(
        "--renderSettingsPrimPath",
        "-rs",
        metavar="PRIM",
        help="the RenderSettings (default: the stage's renderSettingsPrimPath, else the first)",
    )
    settings.add_argument(
        "--renderPassPrimPath",
        "-rp",
        metavar="PRIM",
        help="the RenderPass whose renderSource are the RenderSettings",
    )
    view.add_argument(
        "--disableDrawMode",
        action="store_true",
        help="draw all models' geometry, no cards or boxes",
    )
    view.add_argument(
        "--disableCameraLight",
        action="store_true",
        help="add no light to a stage that has none",
    )
    domes = view.add_mutually_exclusive_group()
    domes.add_argument(
        "--enableDomeLightVisibility",
        dest="domes_visible",
        action="store_true",
        default=True,
        help="the camera sees domes and distant lights (this is the default)",
    )
    domes.add_argument(
        "--disableDomeLightVisibility",
        dest="domes_visible",
        action="store_false",
        help="it does not, though they light the scene",
    )
    view.add_argument(
        "--colorSpace",
        metavar="NAME",
        help="linear RGB space of the rendering and the picture, such as lin_ap1_scene for "
        "ACEScg (default: the render settings' renderingColorSpace, else lin_rec709_scene)",
    )
    view.add_argument(
        "--texture-memory",
        metavar="MIB",
        type=float,
        help="halve the largest textures until all take at most this (default: no limit)",
    )
    _add_opening_flags(parser.add_argument_group("how the stage is opened"))
    return view


def _add_opening_flags(opening: argparse._ArgumentGroup) -> None:
    opening.add_argument(
        "--mask", metavar="PRIM[,PRIM]", help="read only these prims and what is below them"
    )
    opening.add_argument("--sessionLayer", metavar="FILE", help="layer with stronger opinions")
    opening.add_argument(
        "--variant",
        metavar="/PRIM:SET=CHOICE",
        action="append",
        default=[],
        help="choose a variant; may be given several times",
    )
    opening.add_argument(
        "--set",
        metavar="/PRIM.ATTRIBUTE=VALUE",
        action="append",
        default=[],
        help="set an attribute to a value as .usda files have it; may be given several times",
    )
    opening.add_argument(
        "--search-path",
        metavar="FOLDER",
        action="append",
        default=[],
        help="look there for assets that are not beside the stage; may be given several times",
    )
    opening.add_argument(
        "--resolver",
        choices=get_args(ResolverContext),
        default="root",
        help="resolver context: that of the stage's own file, or the environment's "
        "(default: %(default)s)",
    )


def load_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The flags as options of :func:`usdmlt.load`; ValueError for what they cannot be."""
    width, height = arguments.res or (arguments.imageWidth, None)
    check_resolution(width, height)
    if arguments.colorSpace is not None:
        from usdmlt.color import rendering_space_name

        rendering_space_name(arguments.colorSpace)
    return {
        "camera": arguments.camera,
        "width": width,
        "height": height,
        "crop": None if arguments.crop is None else tuple(arguments.crop),
        "purposes": _split(arguments.purposes),
        "complexity": arguments.complexity,
        "double_sided": arguments.double_sided,
        "render_settings": arguments.renderSettingsPrimPath,
        "render_pass": arguments.renderPassPrimPath,
        "draw_modes": not arguments.disableDrawMode,
        "default_light": not arguments.disableCameraLight,
        "domes_visible": arguments.domes_visible,
        "color_space": arguments.colorSpace,
        "texture_memory": arguments.texture_memory,
        "mask": _split(arguments.mask),
        "session_layer": arguments.sessionLayer,
        "variants": _assignments("--variant", arguments.variant, "/PRIM:SET=CHOICE"),
        "overrides": _assignments("--set", arguments.set, "/PRIM.ATTRIBUTE=VALUE"),
        "search_paths": tuple(arguments.search_path),
        "resolver": arguments.resolver,
    }


def _assignments(flag: str, items: list[str], form: str) -> dict[str, str]:
    """``target=value`` of each item; of two with the same target the later counts."""
    result = {}
    for item in items:
        target, equals, value = item.partition("=")
        if not equals or not target.startswith("/"):
            raise UsageError(f"{flag} {item!r} is not {form}")
        result[target.strip()] = value.strip()
    return result


def _split(names: str | None) -> tuple[str, ...] | None:
    return None if names is None else tuple(names.replace(",", " ").split())
