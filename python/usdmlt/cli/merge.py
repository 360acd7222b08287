"""`usdmlt merge PART... -o OUTPUT`: the picture of parts that `usdmlt render --units` rendered."""

from __future__ import annotations

import argparse
import logging
from typing import Any

from usdmlt.cli.logs import add_verbosity
from usdmlt.errors import UsageError

logger = logging.getLogger("usdmlt")


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand and its flags."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "merge",
        help="make one picture of parts that --units rendered",
        description="Sum part files, or checkpoints, of one render to OUTPUT: the same bits as if "
        "one process had rendered all units.",
        allow_abbrev=False,
    )
    parser.add_argument("parts", metavar="PART.exr", nargs="+", help="in any order")
    parser.add_argument(
        "--output", "-o", metavar="OUTPUT", required=True, help="an .exr, or a .png or .jpg"
    )
    parser.add_argument(
        "--allow-gaps",
        action="store_true",
        help="make the picture of the units that are there, where others are missing",
    )
    parser.add_argument(
        "--part",
        action="store_true",
        help="write a part again, to be merged with others, or resumed as a --checkpoint",
    )
    parser.add_argument(
        "--compression", metavar="NAME[:LEVEL]", default="zip", help="as of `usdmlt render`"
    )
    parser.add_argument(
        "--pixel-type", choices=("half", "float"), default="half", help="as of `usdmlt render`"
    )
    parser.add_argument("--multipart", action="store_true", help="as of `usdmlt render`")
    add_verbosity(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Merge the parts; the exit status."""
    from usdmlt import exr, files, image, parts, units
    from usdmlt.merging import merge

    output = image.check_extension(arguments.output)
    if arguments.part and output.suffix.lower() != ".exr":
        raise UsageError("--part needs an OUTPUT.exr: a part has more than a view can hold")
    how = exr.Format(arguments.compression, arguments.pixel_type, arguments.multipart)
    files.check_writable(output)
    merged = merge(arguments.parts, arguments.allow_gaps or arguments.part)
    if arguments.part:
        parts.write(output, merged, how.compression)
    else:
        merged.image.write(
            output,
            compression=how.compression,
            pixel_type=how.pixel_type,
            multipart=how.multipart,
        )
    logger.info(
        "wrote %s: units %s of %d, of %d part%s",
        output,
        units.describe(merged.state.units),
        merged.units_total,
        len(arguments.parts),
        "s" if len(arguments.parts) > 1 else "",
    )
    return 0
