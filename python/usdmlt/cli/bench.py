"""`usdmlt bench`: tables of speed and of equal-time error."""

from __future__ import annotations

import argparse
import importlib.resources
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from usdmlt import files
from usdmlt.cli.logs import add_verbosity
from usdmlt.errors import UsageError
from usdmlt.settings import IntegratorName, ResolvedIntegrator, Settings

if TYPE_CHECKING:
    from usdmlt import benchmark, equal_time
    from usdmlt.scene import Scene

WIDTH = 256
EQUAL_TIME_SCENES = ("cornell_box", "door_ajar", "caustics", "pool", "small_aperture", "keyhole")


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "bench",
        help="measure the integrators",
        description="Render scenes on one thread and print what the integrators do per second of "
        "processor time: samples, of mlt mutations; rays, and those of Embree alone for the same "
        "rays; relMSE x seconds (lower is better); beside them Mitsuba 3's path integrator where "
        "it is installed. With --equal-time: their errors in the same time, against references.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "scenes", metavar="SCENE", nargs="*", help="stages (default: scenes that ship)"
    )
    parser.add_argument(
        "--imageWidth", "-w", metavar="N", type=int, default=WIDTH, help="default: %(default)s"
    )
    parser.add_argument(
        "--depth", metavar="N", type=int, default=8, help="edges of a path (default: %(default)s)"
    )
    parser.add_argument(
        "--integrators",
        metavar="NAME,...",
        help="which (default: path,bdpt,mlt, and auto with --equal-time)",
    )
    parser.add_argument("--json", metavar="FILE", help="write the rows there as well")
    speed = parser.add_argument_group("speed")
    speed.add_argument(
        "--samples", metavar="N", type=int, default=16, help="per pixel (default: %(default)s)"
    )
    speed.add_argument("--no-mitsuba", action="store_true", help="leave Mitsuba 3 out")
    error = parser.add_argument_group("equal-time error")
    error.add_argument(
        "--equal-time", metavar="SECONDS", type=float, help="of processor time, per picture"
    )
    error.add_argument(
        "--seeds", metavar="N", type=int, default=8, help="pictures each (default: %(default)s)"
    )
    error.add_argument(
        "--reference-time",
        metavar="SECONDS",
        type=float,
        help="of processor time, per reference (default: 20 times that of a picture)",
    )
    add_verbosity(parser)
    parser.set_defaults(run=run, parser=parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the tables, scene by scene."""
    from usdmlt.stage import load

    Settings(samples=arguments.samples, depth=arguments.depth)  # refuses what cannot be rendered
    measure = _speed if arguments.equal_time is None else _equal_time
    integrators = _integrators(arguments)
    if arguments.json:
        files.check_writable(arguments.json)
    results: dict[str, list[Any]] = {}
    for path in arguments.scenes or shipped_scenes(arguments.equal_time is not None):
        scene = load(path, width=arguments.imageWidth)
        name = Path(path).stem
        print(f"\n{name}, {scene.width}x{scene.height}, {arguments.depth} edges", flush=True)
        results[name] = []
        for row, line in measure(scene, integrators, arguments):
            print(line, flush=True)
            results[name].append(row)
    if arguments.json:
        files.write_text(arguments.json, json.dumps(results, indent=2) + "\n")
    return 0


def shipped_scenes(equal_time: bool = False) -> list[str]:
    """The scenes of the package; of the checkout where it is used in place."""
    installed = Path(str(importlib.resources.files("usdmlt"))) / "scenes"
    folder = installed if installed.is_dir() else installed.parents[2] / "scenes"
    if equal_time:
        return [str(folder / f"{name}.usda") for name in EQUAL_TIME_SCENES]
    return [str(path) for path in sorted(folder.glob("*.usda"))]


def _integrators(arguments: argparse.Namespace) -> list[Any]:
    known = get_args(ResolvedIntegrator if arguments.equal_time is None else IntegratorName)
    if arguments.equal_time is not None:
        Settings(time=arguments.equal_time)
        Settings(time=arguments.reference_time)
        if arguments.seeds < 2:
            raise UsageError("errors come from the differences of seeds: two of them at least")
    if arguments.integrators is None:
        return sorted(known, key=lambda name: name == "auto")
    names: list[str] = arguments.integrators.split(",")
    for name in names:
        if name not in known:
            raise UsageError(f"unknown integrator {name!r}: here are {', '.join(known)}")
    return names


def _speed(
    scene: Scene, integrators: list[Any], arguments: argparse.Namespace
) -> Iterator[tuple[Any, str]]:
    from usdmlt import benchmark

    print(
        f"{'':<28}{'samples/s':>12}{'rays each':>10}{'rays/s':>10}{'Embree alone':>14}"
        f"{'ratio':>7}{'relMSE*s':>11}{'mean':>9}"
    )
    for integrator in integrators:
        row = benchmark.measure(scene, integrator, arguments.samples, arguments.depth)
        yield asdict(row), _speed_line(row)
    if arguments.no_mitsuba:
        return
    for other in benchmark.measure_mitsuba(scene, arguments.samples, arguments.depth):
        if isinstance(other, str):
            yield other, other
        else:
            yield asdict(other), _speed_line(other)


def _speed_line(row: benchmark.Measurement) -> str:
    name = "mlt (mutations)" if row.renderer == "mlt" else row.renderer
    line = f"{name:<28}{row.samples_per_second / 1e3:>10.0f} k"
    if row.rays_per_second and row.embree_rays_per_second:
        line += (
            f"{row.rays_per_sample:>10.2f}{row.rays_per_second / 1e6:>8.2f} M"
            f"{row.embree_rays_per_second / 1e6:>12.2f} M"
            f"{row.rays_per_second / row.embree_rays_per_second:>7.2f}"
        )
    else:
        line += " " * 41
    return line + f"{row.rel_mse_seconds:>11.4g}{row.mean:>9.4f}"


def _equal_time(
    scene: Scene, integrators: list[Any], arguments: argparse.Namespace
) -> Iterator[tuple[Any, str]]:
    from usdmlt import equal_time

    seconds = arguments.equal_time
    reference = equal_time.make_reference(
        scene, arguments.reference_time or 20 * seconds, arguments.depth
    )
    yield (
        {
            "reference": reference.integrator,
            "seconds": reference.seconds,
            "rel_mse": reference.rel_mse,
            "fireflies": reference.fireflies,
        },
        f"reference: {reference.integrator}, {reference.seconds:.0f} s in all, relMSE of a half "
        f"{reference.rel_mse:.2g}, {100 * reference.fireflies:.0f} % of it in a thousandth of the "
        f"values\n{'':<12}{'samples':>8}{'s':>7}{'relMSE*s':>20}{'trimmed':>19}"
        f"{'16x16 relMSE*s':>22}{'spread':>9}"
        f"{'cv/√N':>8}{'mean/reference':>18}{'16x16':>7}",
    )
    for integrator in integrators:
        row = equal_time.measure(
            scene, integrator, reference, seconds, arguments.seeds, arguments.depth
        )
        yield asdict(row), _equal_time_line(row)


def _equal_time_line(row: equal_time.Row) -> str:
    name = row.integrator if row.integrator == row.chosen else f"{row.integrator} ({row.chosen})"

    def error(value: float, deviation: float, digits: int) -> str:
        return f"{value * row.seconds:.{digits}g} ± {deviation * row.seconds:.1g}"

    pixel = error(row.rel_mse, row.rel_mse_error, 4)
    trimmed = error(row.trimmed_rel_mse, row.trimmed_rel_mse_error, 4)
    block = error(row.block_rel_mse, row.block_rel_mse_error, 3)
    b_spread = "" if row.b_spread is None else f"{100 * row.b_spread:.2f} %"
    return (
        f"{name:<12}{row.samples:>8.0f}{row.seconds:>7.2f}"
        f"{pixel:>20}{trimmed:>19}{block:>22}"
        f"{100 * row.spread:>7.2f} %{b_spread:>8}"
        f"{f'{row.mean_ratio:.4f} ± {row.mean_ratio_error:.4f}':>18}{row.block_deviation:>7.2f}"
    )
