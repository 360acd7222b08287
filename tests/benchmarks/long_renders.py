"""What checkpoints and a cluster cost, and how large films and checkpoints are.

    python tests/benchmarks/long_renders.py [--scene SCENE] [--width W] [--seconds S]
        [--integrator mlt] [--only checkpoints|cluster|sizes]

"checkpoints": the part of a render's time that is spent in writing them at default settings, and
the render's time with and without. "cluster": the same render by 2 threads of one process and by
2 workers of 1 thread, from the scene to the picture; with the time in which the workers start, and
without; and in seconds of processor time, of all processes, which other work on the machine changes
less. "sizes": bytes of films by integrator and layers, and what writing them takes.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path
from time import perf_counter

import usdmlt
from usdmlt import cluster, parts
from usdmlt.checkpoint import Checkpoint
from usdmlt.cluster import connection

ROOT = Path(__file__).parents[2]
LAYERS = (
    "emission,direct,indirect,diffuse,specular,transmission,caustics,a=C.D[LO],b=C.S[LO],c=CD[LO]"
)
THREADS = 2


def samples_for(scene: usdmlt.Scene, integrator: str, seconds: float) -> int:
    """Samples per pixel that take so long with both threads, where they have a processor each."""
    probe = usdmlt.Rendering(scene, settings(integrator, 2**20, time=max(seconds / 10, 2.0)))
    probe.run()
    stats = probe.stats()
    return max(int(stats["samples_per_pixel"] * seconds * THREADS / stats["cpu_seconds"]), 1)


def settings(integrator: str, samples: int, **more: object) -> usdmlt.Settings:
    return usdmlt.Settings(integrator=integrator, samples=samples, threads=THREADS, **more)


class Timed(Checkpoint):
    """Counts the seconds in which the render waits for it."""

    waited = 0.0
    writes = 0

    def update(self, rendering: usdmlt.Rendering) -> None:
        started = perf_counter()
        super().update(rendering)
        self.waited += perf_counter() - started
        self.writes += 1


def checkpoints(scene: usdmlt.Scene, integrator: str, samples: int) -> None:
    times = {}
    for name in ("without", "with"):
        with tempfile.TemporaryDirectory() as folder:
            checkpoint = Timed(Path(folder) / "c.exr") if name == "with" else None
            rendering = usdmlt.Rendering(scene, settings(integrator, samples))
            started = perf_counter()
            rendering.run(checkpoint=checkpoint)
            times[name] = perf_counter() - started
            if checkpoint is not None:
                share = checkpoint.waited / times[name]
                size = checkpoint.path.stat().st_size if checkpoint.path.exists() else 0
                print(
                    f"checkpoints: {checkpoint.writes} of {size / 1e6:.0f} MB took "
                    f"{checkpoint.waited:.2f} s of {times[name]:.1f} s, {share:.2%}"
                )
    change = times["with"] / times["without"] - 1
    print(f"the render took {times['without']:.1f} s without and {change:+.2%} with them")


def processor_seconds() -> float:
    """Of this process, and of those that it has started and that have ended."""
    return sum(os.times()[:4])


def on_workers(scene: usdmlt.Scene, integrator: str, samples: int) -> None:
    started, cpu = perf_counter(), processor_seconds()
    here = usdmlt.Rendering(scene, settings(integrator, samples))
    here.run()
    one, cpu_one = perf_counter() - started, processor_seconds() - cpu
    started, cpu = perf_counter(), processor_seconds()
    with connection.local(2, THREADS) as client:
        ready = perf_counter()
        there = usdmlt.Rendering(scene, settings(integrator, samples))
        cluster.render(client, there)
        several = perf_counter() - ready
        whole = perf_counter() - started
    cpu_several = processor_seconds() - cpu
    same = (there.image()["color"] == here.image()["color"]).all()
    print(
        f"cluster: 2 threads {one:.1f} s, 2 workers x 1 thread {several:.1f} s "
        f"({several / one - 1:+.1%}), with their start {whole:.1f} s ({whole / one - 1:+.1%}); "
        f"processor time {cpu_one:.1f} s, {cpu_several:.1f} s ({cpu_several / cpu_one - 1:+.1%}); "
        f"{'the same bits' if same else 'OTHER BITS'}"
    )


def sizes(scene: usdmlt.Scene) -> None:
    print("| integrator | layers | error | bytes per pixel | 1920x1080 | 3840x2160 |")
    print("|---|---|---|---|---|---|")
    for integrator in ("path", "mlt"):
        for aovs, count in (("", 0), (LAYERS, 10)):
            for error in (True, False):
                made = usdmlt.Rendering(
                    scene, settings(integrator, 1, aovs=aovs or (), error=error)
                )
                planes = made.state().sums.values()
                each = sum(plane.nbytes for plane in planes) / (scene.width * scene.height)
                gib = [each * w * h / 2**30 for w, h in ((1920, 1080), (3840, 2160))]
                print(
                    f"| {integrator} | {count} | {'yes' if error else 'no'} | {each:.0f} "
                    f"| {gib[0]:.2f} GiB | {gib[1]:.2f} GiB |"
                )
    made.run(until=1)
    part = made.part()
    for compression in ("none", "zip"):
        with tempfile.TemporaryDirectory() as folder:
            started = perf_counter()
            parts.write(Path(folder) / "a.exr", part, compression)
            seconds = perf_counter() - started
            film = sum(plane.nbytes for plane in part.state.sums.values())
            size = (Path(folder) / "a.exr").stat().st_size
            print(
                f"{compression}: a film of {film / 1e6:.0f} MB is a file of {size / 1e6:.0f} MB, "
                f"written in {seconds:.2f} s"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default=str(ROOT / "scenes" / "cornell_box.usda"))
    parser.add_argument("--width", type=int, default=512)
    parser.add_argument("--seconds", type=float, default=130.0)
    parser.add_argument("--integrator", default="mlt")
    parser.add_argument("--only", choices=("checkpoints", "cluster", "sizes"))
    arguments = parser.parse_args()
    scene = usdmlt.load(arguments.scene, width=arguments.width)
    wanted = {arguments.only} if arguments.only else {"checkpoints", "cluster", "sizes"}
    integrator = arguments.integrator
    if "sizes" in wanted:
        sizes(scene)
    if "cluster" in wanted:
        on_workers(scene, integrator, samples_for(scene, integrator, 60.0))
    if "checkpoints" in wanted:
        checkpoints(scene, integrator, samples_for(scene, integrator, arguments.seconds))


if __name__ == "__main__":
    main()
