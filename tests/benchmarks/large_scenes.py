"""How long large scenes take to build and to begin, and what memory they need at most.

    python tests/benchmarks/large_scenes.py [SCENE...] [--threads N] [--isa avx2]

Each scene is measured in a process of its own. "build" is from the description's arrays to the
committed acceleration structure, "first sample" the first sample of every pixel after that.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from usdmlt import scene as s

WIDTH, HEIGHT = 320, 180


def wavy_sheet(n: int, half: float = 0.5) -> s.Mesh:
    """2 n² triangles."""
    x = np.linspace(-half, half, n + 1, dtype=np.float32)
    X, Z = np.meshgrid(x, x, indexing="ij")
    Y = np.float32(0.2) * np.sin(9 * X) * np.cos(7 * Z)
    points = np.stack([X, Y, Z], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = (i * (n + 1) + j).ravel().astype(np.int32)
    triangles = np.concatenate(
        [np.stack([a, a + 1, a + n + 2], -1), np.stack([a, a + n + 2, a + n + 1], -1)]
    )
    return s.Mesh(points, triangles)


def placements(count: int, spread: float) -> np.ndarray:
    """Random rotations and places in a cube."""
    rng = np.random.default_rng(1)
    q = rng.normal(size=(count, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    m = np.tile(np.eye(4), (count, 1, 1))
    m[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], -1)
    m[:, 1, :3] = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], -1)
    m[:, 2, :3] = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], -1)
    m[:, 3, :3] = rng.uniform(-spread, spread, (count, 3))
    return m


def lit(**content: object) -> s.Scene:
    camera = s.Camera(window=(-0.64, 0.64, -0.36, 0.36))
    camera.transform[3, 2] = 14.0
    return s.Scene(
        camera,
        WIDTH,
        HEIGHT,
        materials=[s.Material(s.Diffuse((0.6, 0.6, 0.6)))],
        lights=[s.DomeLight((1, 1, 1))],
        **content,
    )


def instanced(triangles: int, instances: int) -> s.Scene:
    """One prototype of so many triangles, placed so many times."""
    prototype = s.Prototype([wavy_sheet(round((triangles / 2) ** 0.5))])
    return lit(prototypes=[prototype], instances=[s.Instances(0, placements(instances, 4.0))])


def separate(meshes: int, triangles: int) -> s.Scene:
    """So many meshes, each with arrays of its own."""
    sheets = []
    for m in placements(meshes, 4.0):
        sheet = wavy_sheet(round((triangles / 2) ** 0.5), 0.25)
        sheet.transform = m
        sheets.append(sheet)
    return lit(meshes=sheets)


SCENES: dict[str, Callable[[], s.Scene]] = {
    "1 000 instances of 1 000 000 triangles": lambda: instanced(1_000_000, 1000),
    "5 000 meshes of 800 triangles": lambda: separate(5000, 800),
    "100 000 instances of 10 000 triangles": lambda: instanced(10_000, 100_000),
}


def peak_memory() -> int:
    """Of this process, in bytes."""
    status = Path("/proc/self/status")
    if status.exists():  # rusage would count what the parent had when it forked
        return 1024 * int(status.read_text().split("VmHWM:")[1].split()[0])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def measure(make: Callable[[], s.Scene], threads: int = 1, isa: str = "avx2") -> dict[str, float]:
    """Seconds and bytes."""
    from usdmlt.embree import find_library
    from usdmlt.native import core

    module = core()
    description = make()
    before = peak_memory()
    start = time.perf_counter()
    built = module.Scene(description, str(find_library()), isa)
    build = time.perf_counter() - start
    render = module.Render(built, integrator="path", samples=1, depth=4)
    start = time.perf_counter()
    render.run(render.units_total, threads)
    first = time.perf_counter() - start
    assert np.isfinite(render.image()).all()
    assert render.image().any()
    return {
        "build": build,
        "first sample": first,
        "description memory": before,
        "peak memory": peak_memory(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="part of a scene's name")
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--isa", default="avx2")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(SCENES[options.one], options.threads, options.isa)))
        return
    print(f"{'scene':42}{'build':>9}{'first sample':>14}{'peak memory':>13}")
    for name in SCENES:
        if options.scenes and not any(part in name for part in options.scenes):
            continue
        command = [sys.executable, __file__, "--one", name, "--threads", str(options.threads),
                   "--isa", options.isa]  # fmt: skip
        got = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        print(
            f"{name:42}{got['build']:7.2f} s{got['first sample']:12.2f} s"
            f"{got['peak memory'] / 2**20:9.0f} MiB"
        )


if __name__ == "__main__":
    main()
