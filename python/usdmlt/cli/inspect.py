"""`usdmlt inspect STAGE`: what would be rendered, and what would not."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from usdmlt.cli.logs import add_verbosity
from usdmlt.cli.reading import add_view_flags, load_options

if TYPE_CHECKING:
    from usdmlt.stage import Inspection
    from usdmlt.stage.contents import PrimCount

NAMES_SHOWN = 5


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand and its flags."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "inspect",
        help="say what of a stage would be rendered",
        description="Read STAGE as `render` would, and print what is in it and, with prim paths, "
        "what would not be rendered as authored.",
        allow_abbrev=False,
    )
    view = add_view_flags(parser)
    times = view.add_mutually_exclusive_group()
    times.add_argument("--frame", metavar="TIME", type=float, help="time code (default: the start)")
    times.add_argument(
        "--defaultTime", "-d", action="store_true", help="the values without time samples"
    )
    parser.add_argument("--json", action="store_true", help="print all of it as JSON")
    add_verbosity(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the inspection; 0."""
    options = load_options(arguments)
    from usdmlt.stage import inspect

    frame = "default" if arguments.defaultTime else arguments.frame
    inspection = inspect(arguments.stage, frame=frame, **options)
    if arguments.json:
        print(json.dumps(asdict(inspection), indent=2))
        return 0
    for line in lines(inspection, everything=arguments.verbosity > 0):
        print(line)
    return 0


def lines(content: Inspection, everything: bool = False) -> Iterator[str]:
    """The inspection as text. ``everything``: all names and prim paths, however many."""
    frame = "default time" if content.frame is None else f"frame {content.frame:g}"
    yield f"stage      {content.stage}, {frame}"
    yield f"           {content.up_axis} up, 1 unit = {content.meters_per_unit:g} m"
    yield from _prim_table(content.prims)
    settings = "".join(f", {name} {value}" for name, value in content.settings.items())
    yield f"settings   {content.render_settings or 'none'}{settings}"
    yield from (f"           product {path}: {name}" for path, name in content.products)
    for name, shows in content.layers:
        yield f"           layer {name}" + (f": {shows}" if shows != name else "")
    yield f"camera     {content.camera or '(automatic)'}: {content.camera_reason}"
    lens = f"lens radius {content.lens_radius:g}" if content.lens_radius else "in focus everywhere"
    yield f"           {content.projection}, {lens}, exposure x {content.exposure:g}"
    size = f"{content.width}x{content.height}"
    if content.data_window is not None:
        x, y, full_width, full_height = content.data_window
        size += f" from ({x}, {y}) of {full_width}x{full_height}"
    yield f"picture    {size}, {content.color_space}, purposes {', '.join(content.purposes)}"
    yield f"geometry   {content.meshes:,} meshes, {content.triangles:,} triangles"
    if content.instances:
        yield (
            f"instances  {content.instances:,} of {content.prototypes:,} prototypes: "
            f"{content.triangles_instanced:,} triangles in all"
        )
    limit = None if everything else NAMES_SHOWN
    yield from _listed("materials", content.materials, limit)
    if content.media:
        yield from _listed("media", content.media, limit)
        if content.world_medium is not None:
            yield f"           {content.world_medium} fills the world"
    if content.volumes:
        yield from _listed("volumes", content.volumes, limit)
    families = Counter(family for family, _ in content.lights)
    summary = ", ".join(f"{count} {family}" for family, count in families.items())
    yield f"lights     {summary or 'none'}"
    if everything:
        yield from (f"           {name}" for _, name in content.lights)
    names = [f"{name} {width}x{height}" for name, width, height in content.textures]
    yield from _listed("textures", names, limit)
    if content.texture_bytes:
        yield f"           {content.texture_bytes / 2**20:,.1f} MiB"
    for warning in content.warnings:
        yield f"warning    {warning.kind}"
        yield from _indented(warning.paths, limit)
    if not content.warnings:
        yield "warnings   none: all of it is rendered"


def _prim_table(prims: list[PrimCount]) -> Iterator[str]:
    """Types, how many and what becomes of them, in columns."""
    width = max((len(row.type) for row in prims), default=0)
    for i, row in enumerate(prims):
        title = "prims" if i == 0 else ""
        yield f"{title:<11}{row.type or '(no type)':<{max(width, 9)}}{row.count:>9,}  {row.fate}"


def _listed(title: str, names: list[str], limit: int | None) -> Iterator[str]:
    yield f"{title:<11}{len(names):,}"
    yield from _indented(names, limit)


def _indented(names: list[str], limit: int | None) -> Iterator[str]:
    yield from (f"           {name}" for name in names[:limit])
    if limit is not None and len(names) > limit:
        yield f"           … {len(names) - limit:,} more (-v lists them)"
