"""The flags of renders that are long: in pieces, and gone on with."""

from __future__ import annotations

import argparse
import logging
from typing import TYPE_CHECKING

from usdmlt.errors import UsageError

if TYPE_CHECKING:
    from usdmlt.checkpoint import Checkpoint
    from usdmlt.rendering import Rendering
    from usdmlt.units import Range

logger = logging.getLogger("usdmlt")


def add_long_flags(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    long = parser.add_argument_group("long renders")
    long.add_argument(
        "--checkpoint",
        metavar="FILE.exr",
        help="keep the work so far there: every minute, or less often where that would take more "
        "than 1%% of the time; at the end; and at SIGINT, SIGTERM and SIGUSR1; with --frames its "
        "name holds a placeholder",
    )
    long.add_argument(
        "--checkpoint-seconds",
        metavar="SECONDS",
        type=float,
        help="the time between checkpoints, whatever they take",
    )
    long.add_argument(
        "--resume",
        action="store_true",
        help="go on from the --checkpoint, if it is there yet; with more --samples or --mutations "
        "than before, a finished picture is extended",
    )
    long.add_argument(
        "--units",
        metavar="A:B|K/N",
        help="render the work units A to B-1 only, or chunk K of N, counted from 0: OUTPUT is a "
        "part, for `usdmlt merge`",
    )


def add_cluster_flags(parser: argparse.ArgumentParser) -> None:
    """Declare those of Dask."""
    cluster = parser.add_argument_group("on several machines, by Dask")
    where = cluster.add_mutually_exclusive_group()
    where.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="of a `dask scheduler`, tcp://HOST:PORT or tls://HOST:PORT, whose workers render",
    )
    where.add_argument(
        "--workers",
        metavar="N",
        type=int,
        help="start N worker processes on this machine, which share the --threads",
    )


def check_long_flags(arguments: argparse.Namespace) -> None:
    """Raise ValueError for flags that do not go together."""
    from usdmlt import units

    if arguments.checkpoint is None:
        for flag, given in (
            ("--resume", arguments.resume),
            ("--checkpoint-seconds", arguments.checkpoint_seconds is not None),
        ):
            if given:
                raise UsageError(f"{flag} needs a --checkpoint FILE.exr")
    if arguments.workers is not None and not 1 <= arguments.workers <= 1024:
        raise UsageError(f"--workers must be between 1 and 1024, not {arguments.workers}")
    if arguments.units is not None:
        units.parse(arguments.units)
        if arguments.made is not None:
            raise UsageError("--units are of a render, and not of one that is made again --from")
        if arguments.error is not None:
            raise UsageError("--error is of a whole picture, and --units are a part of one")
        if arguments.output is None or not arguments.output.lower().endswith(".exr"):
            raise UsageError("--units need an OUTPUT.exr: a part has more than a view can hold")


def chunk(arguments: argparse.Namespace, rendering: Rendering, until: int | None) -> Range:
    """The units that are to be rendered."""
    from usdmlt import units

    if arguments.units is None:
        return 0, rendering.units_total if until is None else until
    return units.resolve(arguments.units, rendering.units_total)


def tell_how_to_go_on(wanted: Range, rendering: Rendering, checkpoint: Checkpoint | None) -> None:
    """Where some of the work is left."""
    from usdmlt import units

    if not units.gaps(wanted, rendering.units) or rendering.is_good_enough():
        return
    if checkpoint is not None:
        logger.info("%s has the work so far: the same with --resume goes on", checkpoint.path)
