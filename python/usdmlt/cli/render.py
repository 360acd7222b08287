"""`usdmlt render STAGE OUTPUT`: render frames of a stage to image files."""

from __future__ import annotations

import argparse
import json
import logging
import os
import signal
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

from usdmlt.cli.asked import Asked, read_asked
from usdmlt.cli.frames import check_placeholder, frame_path, parse_frames
from usdmlt.cli.logs import add_verbosity
from usdmlt.cli.long import (
    add_long_flags,
    check_long_flags,
    chunk,
    open_checkpoint,
    tell_how_to_go_on,
)
from usdmlt.cli.pictures import Pictures, add_looking_flags, add_writing_flags
from usdmlt.cli.progress import ProgressStyle
from usdmlt.cli.reading import add_view_flags
from usdmlt.cli.tracing import add_tracing_flags, tracing
from usdmlt.errors import Error, UsageError, named
from usdmlt.settings import MUTATIONS, DirectName, FilterName, IntegratorName, Settings, merged

if TYPE_CHECKING:
    from usdmlt.rendering import Rendering

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


@dataclass(frozen=True)
class Job:
    """One picture: when, of which product (None: the first), and the files it goes to."""

    frame: float | Literal["default"] | None
    product: str | None
    output: str
    stats: str | None
    checkpoint: str | None


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
    if len(jobs) == 1:
        return _render(arguments, asked, jobs[0], pictures)
    return _render_all(arguments, asked, jobs, pictures)


def _render_all(
    arguments: argparse.Namespace, asked: Asked, jobs: Sequence[Job], pictures: Pictures
) -> int:
    """Render pictures one after the other; one that fails does not take the others along."""
    failed = []
    for number, job in enumerate(jobs):
        try:
            status = _render(arguments, asked, job, pictures)
        except (Error, MemoryError) as error:
            logger.error("%s failed: %s", job.output, str(error) or "out of memory")
            failed.append(job.output)
            continue
        if status:
            logger.warning("stopped: %d of %d pictures were begun", number + 1, len(jobs))
            return status
    if failed:
        done = len(jobs) - len(failed)
        raise Error(f"{done} of {len(jobs)} pictures were written, not {named(failed)}")
    return 0


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


def _render(arguments: argparse.Namespace, asked: Asked, job: Job, pictures: Pictures) -> int:
    """Render and write one picture; 0, or 128 + the number of the signal that stopped it."""
    from usdmlt import files, parts, units
    from usdmlt.checkpoint import settings_to_resume
    from usdmlt.cli.progress import display, display_reading
    from usdmlt.interruption import Interruption
    from usdmlt.rendering import Rendering
    from usdmlt.stage import load

    options = dict(asked.options)
    if job.frame is not None:
        options["frame"] = job.frame
    if job.product is not None:
        options["product"] = job.product
    quiet = arguments.verbosity < 0
    checkpoint = open_checkpoint(arguments, job.checkpoint)
    before = checkpoint.read() if checkpoint is not None and arguments.resume else None
    with display_reading(arguments.progress, quiet) as reading:
        scene = load(asked.stage, progress=reading, **options)
    settings = merged(scene.settings, asked.settings)
    if before is not None:
        settings = settings_to_resume(settings, before)
    rendering = Rendering(scene, settings)
    pictures.check_layers(rendering.layers, job.output)
    first, last = chunk(arguments, rendering, asked.until)
    logger.info("%s", _description(asked.stage, rendering))
    if checkpoint is not None and before is not None:
        checkpoint.restore(rendering, before)
        logger.info("%s has units %s", checkpoint.path, units.describe(rendering.units))
    unsaved: Error | None = None
    with (
        Interruption(signal.SIGINT, signal.SIGTERM, always=True) as interruption,
        checkpoint or nullcontext(),
    ):
        with pictures.previews(job.output) as previews:
            with display(settings, arguments.progress, quiet) as progress:
                rendering.run(
                    progress, lambda: bool(interruption), last, previews, first, checkpoint
                )
            if checkpoint is not None:
                try:
                    checkpoint.write(rendering)
                except Error as error:
                    unsaved = error  # the picture may find room
            image = rendering.image() if rendering.units_done else None
            if image is not None:
                try:
                    if arguments.units is not None:
                        parts.write(job.output, rendering.part(), arguments.compression)
                    else:
                        pictures.write(image, job.output)
                except Error as error:
                    if checkpoint is None or unsaved:
                        raise
                    raise Error(f"{error}; {checkpoint.path} has the work, to --resume") from None
        if image is None:
            logger.warning("stopped before any work was done: nothing was written")
        else:
            if job.stats:
                files.write_text(job.stats, json.dumps(image.stats, indent=2) + "\n")
            logger.info("%s", _outcome(job.output, rendering, image.stats))
            if arguments.memstats:
                from usdmlt.cli.memory import memory_report

                logger.info("%s", memory_report(scene))
    if unsaved:
        raise unsaved
    tell_how_to_go_on((first, last), rendering, checkpoint)
    return 0 if interruption.signal is None else 128 + interruption.signal


def _description(stage: str, rendering: Rendering) -> str:
    """What will be rendered and how, defaults included."""
    scene, settings = rendering.scene, rendering.settings
    limits = []
    unlimited = settings.time is None and settings.target_error is None
    if unlimited or settings.samples or settings.mutations:
        limits.append(f"{settings.resolved_samples} {_samples(rendering)}")
    if settings.time is not None:
        limits.append(f"{settings.time:g} s")
    if settings.target_error is not None:
        limits.append(f"error {settings.target_error:g}")
    why = f" (auto: {rendering.choice.reason})" if settings.integrator == "auto" else ""
    return (
        f"{stage}: camera {scene.camera.name or '(automatic)'}, {scene.width}x{scene.height}, "
        f"{rendering.integrator}{why}, {' or '.join(limits)}, depth {settings.depth}, "
        f"{settings.filter} filter, seed {settings.seed}, threads {settings.resolved_threads}"
    )


def _samples(rendering: Rendering) -> str:
    """What the integrator's budget counts."""
    return "mutations per pixel" if rendering.integrator == "mlt" else "samples per pixel"


def _outcome(output: str, rendering: Rendering, stats: dict[str, Any]) -> str:
    """What was written, and how much of the work is in it."""
    from usdmlt import units

    share = (
        "all units"
        if rendering.units_done == rendering.units_total
        else f"units {units.describe(rendering.units)}"
    )
    return (
        f"wrote {output}: {round(stats['samples_per_pixel'], 1):g} {_samples(rendering)} ({share}) "
        f"in {stats['seconds']:.1f} s"
    )
