"""`usdmlt render --workers` and `--cluster`."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import usdmlt

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "usdmlt", *map(str, arguments)]


def run(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments), cwd=folder, capture_output=True, text=True, timeout=120
    )


def assert_same(a: Path, b: Path) -> None:
    first, second = usdmlt.read_image(a), usdmlt.read_image(b)
    assert first.channels.keys() == second.channels.keys()
    for name, pixels in first.channels.items():
        np.testing.assert_array_equal(second[name], pixels, err_msg=name)


def test_workers_are_started_and_give_the_same_bits(tmp_path) -> None:
    flags = ["-w", 64, "--mutations", 200, "--aov", "caustics,N"]
    done = run(tmp_path, "render", SCENE, "a.exr", *flags, "--workers", 2, "--stats", "a.json")
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stderr.splitlines() if " elapsed" not in line]
    assert [line.split()[0] for line in said] == [f"{SCENE}:", "wrote"], said  # nothing of Dask's
    assert (tmp_path / "a.json").exists()
    assert run(tmp_path, "render", SCENE, "b.exr", *flags).returncode == 0
    assert_same(tmp_path / "a.exr", tmp_path / "b.exr")


def test_a_chunk_is_rendered_by_workers(tmp_path) -> None:
    flags = ["-w", 48, "--integrator", "path", "--samples", 20]
    for number, where in ((0, ["--workers", 1]), (1, [])):
        name = f"{number}.exr"
        done = run(tmp_path, "render", SCENE, name, *flags, "--units", f"{number}/2", *where)
        assert done.returncode == 0, done.stderr
    assert run(tmp_path, "merge", "0.exr", "1.exr", "-o", "a.exr").returncode == 0
    run(tmp_path, "render", SCENE, "b.exr", *flags)
    assert_same(tmp_path / "a.exr", tmp_path / "b.exr")


@pytest.mark.slow
def test_frames_are_one_job_on_a_cluster(cluster, tmp_path) -> None:
    cluster.add("a")
    cluster.add("b")
    flags = ["-w", 32, "--samples", 16, "--frames", "1:5"]
    (tmp_path / "a.3.exr").write_bytes(b"there")
    where = ["--cluster", cluster.address]
    done = run(tmp_path, "render", SCENE, "a.#.exr", *flags, "--skip-existing", *where)
    assert done.returncode == 0, done.stderr
    assert sum(line.startswith("wrote") for line in done.stderr.splitlines()) == 4
    assert (tmp_path / "a.3.exr").read_bytes() == b"there"
    run(tmp_path, "render", SCENE, "b.#.exr", *flags)
    for frame in (1, 2, 4, 5):
        assert_same(tmp_path / f"a.{frame}.exr", tmp_path / f"b.{frame}.exr")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_all_processes_of_a_terminal_keeps_the_work(tmp_path, number) -> None:
    """Ctrl-C reaches the workers as well: they finish what they have."""
    flags = ["-w", 64, "--integrator", "mlt", "--samples", 2**18, "--workers", 2]
    process = subprocess.Popen(
        command("render", SCENE, "a.exr", *flags, "--checkpoint", "c.exr"),
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        bufsize=1,
        start_new_session=True,
    )
    assert process.stderr is not None
    assert "mutations per pixel" in process.stderr.readline()
    time.sleep(3)
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 128 + number, said
    done = re.search(r"\(units 0:(\d+)\)", said)
    assert done, said
    assert "c.exr has the work so far: the same with --resume goes on" in said
    scene = usdmlt.load(SCENE, width=64)
    here = usdmlt.Rendering(scene, usdmlt.Settings(integrator="mlt", samples=2**18))
    here.run(until=int(done[1]))
    color = usdmlt.read_image(tmp_path / "a.exr")["color"]
    np.testing.assert_array_equal(color, here.image()["color"].astype(np.float16))


JUMPING = """
import sys, time
real, jumps_at = time.time, time.monotonic() + 7
time.time = lambda: real() + 3600 * {hours} * (time.monotonic() > jumps_at)
from usdmlt.cli import main
if __name__ == "__main__":
    status = main(sys.argv[1:])
    assert time.monotonic() > jumps_at + 2
    sys.exit(status)
"""


@pytest.mark.slow
@pytest.mark.parametrize("hours", [-3, 3])
def test_a_jump_of_the_clock_loses_no_worker(tmp_path, hours) -> None:
    """Of the client's, which is the scheduler's as well, some seconds after the start."""
    (tmp_path / "jumping.py").write_text(JUMPING.format(hours=hours))
    flags = ["-w", "64", "--integrator", "mlt", "--mutations", "4800", "--threads", "1"]
    command = [sys.executable, "jumping.py", "render", str(SCENE), "a.exr", *flags]
    done = subprocess.run(
        [*command, "--workers", "1"], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr
    run(tmp_path, "render", SCENE, "b.exr", *flags)
    assert_same(tmp_path / "a.exr", tmp_path / "b.exr")


@pytest.mark.parametrize(
    ("flags", "status", "said"),
    [
        (["--workers", 0], 2, "--workers must be between 1 and 1024"),
        (["--workers", 2, "--cluster", "tcp://127.0.0.1:9"], 2, "not allowed with"),
        (["--cluster", "nowhere"], 1, "no scheduler of Dask is at nowhere: missing port number"),
        (["--cluster", "htp://a:1"], 1, "no scheduler of Dask is at htp://a:1: unknown"),
        (["--cluster", "tls://127.0.0.1:1"], 1, "has no certificates for tls://"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(tmp_path, flags, status, said) -> None:
    done = run(tmp_path, "render", SCENE, "a.exr", "-w", 16, "--samples", 1, *flags)
    assert done.returncode == status, done.stderr
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_without_dask_it_is_said_what_to_install(tmp_path) -> None:
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "distributed.py").write_text("raise ImportError")
    path = os.pathsep.join([str(tmp_path / "modules"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        command("render", SCENE, "a.exr", "--workers", 2),
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert done.stderr.startswith("usdmlt: error: rendering on workers needs Dask")
