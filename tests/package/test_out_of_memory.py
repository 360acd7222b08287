"""Memory that the system refuses: one line, and nothing that is half-done."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

resource = pytest.importorskip("resource", reason="limits the memory as POSIX does")

# While it goes on with a checkpoint there is a MiB left, which is too little for a thread's stack.
RESUME = """
import resource, sys
import numpy as np
import usdmlt
from usdmlt.checkpoint import Checkpoint
scene = usdmlt.load(sys.argv[1], width=32)
rendering = usdmlt.Rendering(scene, usdmlt.Settings(integrator="mlt", samples=40))
checkpoint = Checkpoint("c.exr")
part = checkpoint.read()
checkpoint.restore(rendering, part)
before = rendering.units_done
size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (size + 2**20, resource.RLIM_INFINITY))
try:
    rendering.run(checkpoint=checkpoint)
except MemoryError:
    print("out of memory:", before, "units,", rendering.units_done, "left")
resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
checkpoint.write(rendering)
checkpoint.restore(rendering, part)
rendering.run()
again = usdmlt.Rendering(scene, rendering.settings)
again.run()
for name, plane in again.state().sums.items():
    np.testing.assert_array_equal(plane, rendering.state().sums[name], err_msg=name)
"""


def test_units_without_memory_are_an_error_and_the_checkpoint_stays(
    stage: Path, tmp_path: Path, usdmlt_command: Callable[..., object]
) -> None:
    """The rendering has no units then, and can go on from the checkpoint in the same process."""
    flags = ["-w", 32, "--integrator", "mlt", "--checkpoint", "c.exr"]
    usdmlt_command("render", stage, "a.exr", *flags, "--mutations", 10)
    before = (tmp_path / "c.exr").read_bytes()
    command = [sys.executable, "-c", RESUME, str(stage)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"out of memory: [1-9]\d* units, 0 left\n", done.stdout)
    assert (tmp_path / "c.exr").read_bytes() == before


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_a_film_larger_than_the_memory_is_an_error_of_a_line(
    stage: Path, tmp_path: Path, integrator: str
) -> None:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30, 4 * 2**30))

    size = ["-w", "16384", "--integrator", integrator, "--samples", "1"]
    command = [sys.executable, "-m", "usdmlt", "render", str(stage), "a.exr", *size]
    command += ["--checkpoint", "c.exr"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, preexec_fn=limit
    )
    assert done.returncode == 1, done.stderr
    assert done.stderr == "usdmlt: error: out of memory\n"
    assert {path.name for path in tmp_path.iterdir()} == {stage.name}
