"""`usdmlt render STAGE OUTPUT`: render frames of a stage to image files."""

from __future__ import annotations

import argparse
import json
import logging
import signal
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, get_args

from usdmlt.cli.frames import check_placeholder, frame_path, parse_frames
from usdmlt.cli.logs import add_verbosity
from usdmlt.cli.view import add_view_flags, load_options
from usdmlt.errors import UsageError
from usdmlt.settings import MUTATIONS, DirectName, FilterName, IntegratorName, Settings

if TYPE_CHECKING:
    from usdmlt.rendering import Rendering

logger = logging.getLogger("usdmlt")


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand and its flags; names as usdrecord's where it has them."""
    defaults = Settings()
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "render",
        help="render a stage to an image file",
        description="Render STAGE to OUTPUT, an .exr (linear RGBA, error.Y) or a .png (sRGB view).",
        allow_abbrev=False,
    )
    view = add_view_flags(parser)
    parser.add_argument(
        "output",
        metavar="OUTPUT",
        help="image file; with --frames its name holds a placeholder: shot.####.exr",
    )
    view.add_argument(
        "--frames",
        "-f",
        metavar="SPEC",
        help="time codes start[:end[xstride]], several separated by commas "
        "(default: the stage's start)",
    )
    view.add_argument(
        "--strict", action="store_true", help="fail where unsupported content would be left out"
    )

    how = parser.add_argument_group("how it is rendered")
    how.add_argument(
        "--integrator",
        choices=get_args(IntegratorName),
        default=defaults.integrator,
        help="path tracing, bidirectional path tracing or Metropolis light transport (default: "
        "auto, the best for the scene as short pilots show)",
    )
    how.add_argument(
        "--samples",
        metavar="N",
        type=int,
        help="samples per pixel, of mlt mutations per pixel "
        f"(default: {defaults.resolved_samples}, or what fits into --time)",
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
        "--depth",
        metavar="N",
        type=int,
        default=defaults.depth,
        help="the most edges of a path; 2 is direct light only (default: %(default)s)",
    )
    how.add_argument(
        "--filter",
        choices=get_args(FilterName),
        default=defaults.filter,
        help="pixel filter (default: %(default)s)",
    )
    how.add_argument(
        "--seed",
        metavar="N",
        type=int,
        default=defaults.seed,
        help="seed of the random numbers (default: %(default)s)",
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
        default=defaults.direct,
        help="who renders direct light: the mutations (mlt) or path tracing (separate) "
        "(default: auto, separate unless path tracing finds it too seldom)",
    )
    mlt.add_argument(
        "--two-stage",
        action=argparse.BooleanOptionalAction,
        default=defaults.two_stage,
        help="make a coarse picture first, so that dark parts get nearly as much work",
    )
    report = parser.add_argument_group("what is reported")
    report.add_argument(
        "--stats",
        metavar="FILE.json",
        help="write the statistics there; with --frames its name holds a placeholder",
    )
    add_verbosity(report)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Render every frame; the exit status."""
    from usdmlt import files, image

    settings = Settings(
        integrator=arguments.integrator,
        samples=arguments.samples,
        mutations=arguments.mutations,
        time=arguments.time,
        depth=arguments.depth,
        seed=arguments.seed,
        threads=arguments.threads,
        filter=arguments.filter,
        mutation_weights=parse_weights(arguments.mutation_weights),
        direct=arguments.direct,
        two_stage=arguments.two_stage,
    )
    options = load_options(arguments)
    frames = None if arguments.frames is None else parse_frames(arguments.frames)
    image.check_extension(arguments.output)
    for path in _outputs(arguments):
        check_placeholder(path, frames)
    for path in _outputs(arguments):
        files.check_writable(path)
    each: Sequence[float | None] = frames or [None]
    for frame in each:
        status = _render_frame(arguments, settings, frame, options)
        if status:
            return status
    return 0


def parse_weights(flags: Sequence[str] | None) -> dict[str, float] | None:
    """`lens=0.4,bidirectional=0.6`, of one flag or several; None where there is none."""
    if flags is None:
        return None
    weights: dict[str, float] = {}
    for item in ",".join(flags).split(","):
        name, _, weight = (part.strip() for part in item.partition("="))
        if name in weights:
            raise UsageError(f"--mutation-weights has two weights for {name}")
        try:
            weights[name] = float(weight)
        except ValueError:
            raise UsageError(f"--mutation-weights: {item!r} is not NAME=WEIGHT") from None
    return weights


def _outputs(arguments: argparse.Namespace) -> list[str]:
    return [arguments.output] + ([arguments.stats] if arguments.stats else [])


def _render_frame(
    arguments: argparse.Namespace,
    settings: Settings,
    frame: float | None,
    options: dict[str, Any],
) -> int:
    """Render and write one frame; 0, or 128 + the number of the signal that stopped it."""
    from usdmlt import files
    from usdmlt.cli.progress import display
    from usdmlt.interruption import Interruption
    from usdmlt.rendering import Rendering
    from usdmlt.stage import load

    scene = load(arguments.stage, frame=frame, strict=arguments.strict, **options)
    rendering = Rendering(scene, settings)
    logger.info("%s", _description(arguments.stage, rendering))
    with Interruption(signal.SIGINT, signal.SIGTERM, always=True) as interruption:
        with display(settings, quiet=arguments.verbosity < 0) as progress:
            rendering.run(progress, stop=lambda: bool(interruption))
        if rendering.units_done == 0:
            logger.warning("stopped before any work was done: nothing was written")
        else:
            image = rendering.image()
            output, stats = (
                path if frame is None or not path else frame_path(path, frame)
                for path in (arguments.output, arguments.stats)
            )
            image.write(output)
            if stats:
                files.write_text(stats, json.dumps(image.stats, indent=2) + "\n")
            logger.info("%s", _outcome(output, rendering, image.stats))
    return 0 if interruption.signal is None else 128 + interruption.signal


def _description(stage: str, rendering: Rendering) -> str:
    """What will be rendered and how, defaults included."""
    scene, settings = rendering.scene, rendering.settings
    limits = []
    if settings.time is None or settings.samples or settings.mutations:
        limits.append(f"{settings.resolved_samples} {_samples(rendering)}")
    if settings.time is not None:
        limits.append(f"{settings.time:g} s")
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
    share = (
        "all units"
        if rendering.units_done == rendering.units_total
        else f"units 0:{rendering.units_done}"
    )
    return (
        f"wrote {output}: {stats['samples_per_pixel']:g} {_samples(rendering)} ({share}) "
        f"in {stats['seconds']:.1f} s"
    )
