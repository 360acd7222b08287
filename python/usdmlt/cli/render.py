"""`usdmlt render STAGE OUTPUT`: render frames of a stage to image files."""

from __future__ import annotations

import argparse
import logging
import os
from collections.abc import Sequence
from typing import Any, Literal, get_args

from usdmlt.cli.asked import Asked, read_asked
from usdmlt.cli.frames import check_placeholder, frame_path, parse_frames
from usdmlt.cli.logs import add_verbosity
from usdmlt.cli.long import add_cluster_flags, add_long_flags, check_long_flags
from usdmlt.cli.pictures import Pictures, add_looking_flags, add_writing_flags
from usdmlt.cli.progress import ProgressStyle
from usdmlt.cli.reading import add_view_flags
from usdmlt.cli.sequence import render_all
from usdmlt.cli.tracing import add_tracing_flags, tracing
from usdmlt.cli.work import Job
from usdmlt.errors import Error, UsageError
from usdmlt.settings import MUTATIONS, DirectName, FilterName, IntegratorName, Settings

logger = logging.getLogger("usdmlt")


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand and its flags; names as usdrecord's where it has them."""
    defaults = Settings()
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "render",
        help="render a stage to an image file",
        description="Render STAGE to OUTPUT: an .exr, linear with all layers, or a .png or .jpg, "
        "a view of it.",
        allow_abbrev=False,
    )
    view = add_view_flags(parser, stage_is_needed=False)
    parser.add_argument(
        "output",
        metavar="OUTPUT",
        nargs="?",
        help="image file; with --frames its name holds a placeholder: shot.####.exr "
        "(default: the products of the render settings)",
    )
    parser.add_argument(
        "--from",
        dest="made",
        metavar="PICTURE.exr",
        help="render a picture of usdmlt again, by what its file says, to OUTPUT "
        "(default: NAME_again.exr); flags change it",
    )
    times = view.add_mutually_exclusive_group()
    times.add_argument(
        "--frames",
        "-f",
        metavar="SPEC",
        help="time codes start[:end[xstride]], several separated by commas "
        "(default: the stage's start)",
    )
    times.add_argument(
        "--defaultTime", "-d", action="store_true", help="the values without time samples"
    )
    view.add_argument(
        "--strict", action="store_true", help="fail where unsupported content would be left out"
    )
    view.add_argument(
        "--list-cameras", action="store_true", help="print the paths of the cameras and do no more"
    )
    add_writing_flags(parser)
    how = parser.add_argument_group(
        "how it is rendered",
        "Without these flags, what the usdmlt: attributes of the render settings say.",
    )
    how.add_argument(
        "--integrator",
        choices=get_args(IntegratorName),
        help="path tracing, bidirectional path tracing or Metropolis light transport (default: "
        "auto, the best for the scene as short pilots show)",
    )
    how.add_argument(
        "--samples",
        metavar="N",
        type=int,
        help="samples per pixel, of mlt mutations per pixel "
        f"(default: {defaults.resolved_samples}, or what fits into --time or --error needs)",
    )
    how.add_argument(
        "--mutations", metavar="N", type=int, help="mutations per pixel: --samples of mlt alone"
    )
    how.add_argument(
        "--time",
        metavar="SECONDS",
        type=float,
        help="stop rendering each frame after this time, reading the stage not counted "
        "(default: no limit)",
    )
    how.add_argument(
        "--error",
        metavar="E",
        type=float,
        help="render until the error of the picture, relative to its luminance, is estimated to be "
        "below this, such as 0.02 (default: the samples decide)",
    )
    how.add_argument(
        "--depth",
        metavar="N",
        type=int,
        help=f"the most edges of a path; 2 is direct light only (default: {defaults.depth})",
    )
    how.add_argument(
        "--filter",
        choices=get_args(FilterName),
        help=f"pixel filter (default: {defaults.filter})",
    )
    how.add_argument(
        "--seed",
        metavar="N",
        type=int,
        help=f"seed of the random numbers (default: {defaults.seed})",
    )
    how.add_argument(
        "--threads",
        metavar="N",
        type=int,
        help="threads (default: as many as the process may run on, "
        f"here {defaults.resolved_threads})",
    )
    mlt = parser.add_argument_group("Metropolis light transport")
    mlt.add_argument(
        "--mutation-weights",
        metavar="NAME=WEIGHT[,...]",
        action="append",
        help="how often each mutation is tried, relative to the others; those left out are not. "
        f"Names: {', '.join(MUTATIONS)} (default: chosen for the scene)",
    )
    mlt.add_argument(
        "--direct",
        choices=get_args(DirectName),
        help="who renders direct light: path tracing alone (separate), or what renders all other "
        "light (mlt) (default: auto, the former unless it finds light at few places only)",
    )
    mlt.add_argument(
        "--selective",
        action=argparse.BooleanOptionalAction,
        help="leave what bidirectional path tracing finds to it, and the rest to the mutations",
    )
    mlt.add_argument(
        "--two-stage",
        action=argparse.BooleanOptionalAction,
        help="make a coarse picture first, so that dark parts get nearly as much work",
    )
    add_long_flags(parser)
    add_cluster_flags(parser)
    add_looking_flags(parser)
    report = parser.add_argument_group("what is reported")
    report.add_argument(
        "--progress",
        choices=get_args(ProgressStyle),
        help="plain: a line now and then; json: a line of JSON a second, on stdout; alfred: "
        "`ALF_PROGRESS 12%%` on stdout (default: a bar on a terminal, else plain)",
    )
    report.add_argument(
        "--stats",
        metavar="FILE.json",
        help="write the statistics there; with --frames its name holds a placeholder",
    )
    add_tracing_flags(report)
    report.add_argument(
        "--memstats",
        action="store_true",
        help="print what memory the scene's arrays take, and the most that the process has had",
    )
    add_verbosity(report)
    usdrecord = parser.add_argument_group("of usdrecord, without effect here")
    usdrecord.add_argument("--disableGpu", action="store_true", help="no GPU is ever used")
    usdrecord.add_argument(
        "--renderer", "-r", choices=("usdmlt",), help="there is one; see --integrator"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Render every frame; the exit status."""
    with tracing(arguments.traceToFile, arguments.traceFormat):
        return _run(arguments)


def _run(arguments: argparse.Namespace) -> int:
    from usdmlt import files

    check_long_flags(arguments)
    asked = read_asked(arguments)
    if arguments.list_cameras:
        from usdmlt.stage import camera_paths

        for camera in camera_paths(asked.stage, **asked.options):
            print(camera)
        return 0
    jobs = _jobs(arguments, asked)
    if arguments.skip_existing:
        jobs = [job for job in jobs if not _exists(job.output)]
    for job in jobs:
        for path in (job.output, job.stats, job.checkpoint):
            if path:
                files.check_writable(path)
    pictures = Pictures(arguments, [job.output for job in jobs])
    return render_all(arguments, asked, jobs, pictures)


def _jobs(arguments: argparse.Namespace, asked: Asked) -> list[Job]:
    """All pictures, their files' names checked."""
    from usdmlt import image

    frames = None if arguments.frames is None else parse_frames(arguments.frames)
    times: Sequence[float | Literal["default"] | None]
    times = ["default"] if arguments.defaultTime else frames or [None]
    if arguments.output is None:
        return _product_jobs(arguments, times, asked.options)
    image.check_extension(arguments.output)
    paths = arguments.output, arguments.stats, arguments.checkpoint
    for path in paths:
        if path:
            check_placeholder(path, frames)
    return [Job(time, None, *(_numbered(path, time) for path in paths)) for time in times]


def _product_jobs(
    arguments: argparse.Namespace,
    times: Sequence[float | Literal["default"] | None],
    options: dict[str, Any],
) -> list[Job]:
    """The products of the render settings; their names may have placeholders, or be animated."""
    from usdmlt import image
    from usdmlt.stage import products

    for flag in ("stats", "checkpoint"):
        if getattr(arguments, flag):
            raise UsageError(f"--{flag} is for one picture: name its OUTPUT")
    jobs = []
    for time in times:
        for product in products(arguments.stage, frame=time, **options):
            try:
                name = str(image.check_extension(product.name))
            except UsageError as error:
                raise Error(f"{product.path}: {error}") from None
            jobs.append(Job(time, product.path, _numbered(name, time) or name, None, None))
    if not jobs:
        raise UsageError("name the OUTPUT: the stage has no render products")
    outputs = [job.output for job in jobs]
    for output in outputs:
        if outputs.count(output) > 1:
            raise Error(f"several pictures would be written to {output}")
    return jobs


def _numbered(path: str | None, time: float | Literal["default"] | None) -> Any:
    return path if time is None or time == "default" or not path else frame_path(path, time)


def _exists(output: str) -> bool:
    there = os.path.isfile(output) and os.path.getsize(output) > 0
    if there:
        logger.info("%s is there already: left out", output)
    return there
