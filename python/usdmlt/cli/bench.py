"""`usdmlt bench`: a table of speed and equal-time error."""

from __future__ import annotations

import argparse
import importlib.resources
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from usdmlt.cli.logs import add_verbosity
from usdmlt.settings import ResolvedIntegrator, Settings

INTEGRATORS: tuple[ResolvedIntegrator, ...] = ("path", "bdpt")


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "bench",
        help="measure the integrators",
        description="Render scenes on one thread and print, per second of processor time: samples, "
        "rays, the rays of Embree alone for the same rays, and relMSE x seconds (lower is better); "
        "beside them Mitsuba 3's path integrator where it is installed.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "scenes", metavar="SCENE", nargs="*", help="stages (default: the scenes that ship)"
    )
    parser.add_argument(
        "--imageWidth", "-w", metavar="N", type=int, help="width in pixels (default: the scene's)"
    )
    parser.add_argument(
        "--samples", metavar="N", type=int, default=16, help="per pixel (default: %(default)s)"
    )
    parser.add_argument(
        "--depth", metavar="N", type=int, default=8, help="edges of a path (default: %(default)s)"
    )
    parser.add_argument("--no-mitsuba", action="store_true", help="leave Mitsuba 3 out")
    parser.add_argument("--json", metavar="FILE", help="write the rows there as well")
    add_verbosity(parser)
    parser.set_defaults(run=run, parser=parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the table, scene by scene."""
    from usdmlt import benchmark
    from usdmlt.stage import load

    Settings(samples=arguments.samples, depth=arguments.depth)  # refuses what cannot be rendered
    results: dict[str, list[Any]] = {}
    for path in arguments.scenes or shipped_scenes():
        scene = load(path, width=arguments.imageWidth)
        name = Path(path).stem
        print(f"\n{name}, {scene.width}x{scene.height}, {arguments.depth} edges")
        print(
            f"{'':<28}{'samples/s':>12}{'rays/s':>10}{'Embree alone':>14}"
            f"{'ratio':>7}{'relMSE*s':>10}{'mean':>9}"
        )
        rows: list[benchmark.Measurement | str] = [
            benchmark.measure(scene, integrator, arguments.samples, arguments.depth)
            for integrator in INTEGRATORS
        ]
        for row in rows:
            print(_line(row), flush=True)
        if not arguments.no_mitsuba:
            for row in benchmark.measure_mitsuba(scene, arguments.samples, arguments.depth):
                print(_line(row), flush=True)
                rows.append(row)
        results[name] = [row if isinstance(row, str) else asdict(row) for row in rows]
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(results, indent=2) + "\n")
    return 0


def shipped_scenes() -> list[str]:
    """The scenes of the package; of the checkout where it is used in place."""
    installed = Path(str(importlib.resources.files("usdmlt"))) / "scenes"
    folder = installed if installed.is_dir() else installed.parents[2] / "scenes"
    return [str(path) for path in sorted(folder.glob("*.usda"))]


def _line(row: Any) -> str:
    if isinstance(row, str):
        return row
    embree, rays = row.embree_rays_per_second, row.rays_per_second
    return (
        f"{row.renderer:<28}{row.samples_per_second / 1e3:>10.0f} k"
        + (
            f"{rays / 1e6:>8.2f} M{embree / 1e6:>12.2f} M{rays / embree:>7.2f}"
            if rays
            else " " * 31
        )
        + f"{row.rel_mse_seconds:>10.4f}{row.mean:>9.4f}"
    )
