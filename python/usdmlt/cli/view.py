"""`usdmlt view PICTURE.exr`: one page of HTML to look at a picture with, offline."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from typing import Any

from usdmlt.cli.logs import add_verbosity

logger = logging.getLogger("usdmlt")


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand and its flags."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "view",
        help="make a page of HTML to look at a picture with",
        description="Write one HTML file with all layers of an EXR, to look at in a browser "
        "without a network: layers, exposure, zoom, pixel values.",
        allow_abbrev=False,
    )
    parser.add_argument("picture", metavar="PICTURE.exr")
    parser.add_argument(
        "--output", "-o", metavar="FILE.html", help="(default: PICTURE.html, beside the picture)"
    )
    parser.add_argument("--open", action="store_true", help="open it in the browser")
    add_verbosity(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Write the page; 0."""
    from usdmlt import files, html_view, image

    picture = Path(arguments.picture)
    output = Path(arguments.output or picture.with_suffix(".html"))
    files.check_writable(output)
    files.write_text(output, html_view.page(image.read(picture), picture.name))
    logger.info("wrote %s", output)
    if arguments.open:
        import webbrowser

        webbrowser.open(output.resolve().as_uri())
    return 0
