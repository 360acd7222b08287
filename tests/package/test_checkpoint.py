"""Checkpoints: a render goes on from them as if it had never stopped, and from nothing else."""

from __future__ import annotations

import errno
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt import parts
from usdmlt.checkpoint import Checkpoint
from usdmlt.errors import Error
from usdmlt.image import Image

Run = Callable[..., "subprocess.CompletedProcess[str]"]
CHAINS = ["--integrator", "mlt", "--direct", "mlt"]  # which have nothing else to do here
FLAGS = ["-w", 64, "--direct", "mlt", "--aov", "direct,N", "--pixel-type", "float"]


def same(a: Image, b: Image) -> bool:
    """The same layers of the same bits, and the same making but for when and how long."""
    assert a.channels.keys() == b.channels.keys()
    told = [{n: str(v) for n, v in i.metadata.items() if n not in ("date", "time")} for i in (a, b)]
    for made in told:
        made.pop("settings")  # names the integrator, or the choice of it
    return told[0] == told[1] and all(np.array_equal(a[n], b[n]) for n in a.channels)


@pytest.mark.parametrize(
    ("integrator", "samples", "more"), [("mlt", 64, 160), ("bdpt", 4, 7), ("path", 3, 8)]
)
def test_a_finished_picture_is_extended_to_the_bits_of_a_longer_render(
    usdmlt_command: Run, stage: Path, tmp_path: Path, integrator: str, samples: int, more: int
) -> None:
    flags = [*FLAGS, "--integrator", integrator]
    run = ["render", stage, "a.exr", *flags, "--checkpoint", "c.exr"]
    assert usdmlt_command(*run, "--samples", samples).returncode == 0
    done = usdmlt_command(*run, "--samples", more, "--resume")
    assert done.returncode == 0, done.stderr
    assert "c.exr has units 0:" in done.stderr
    usdmlt_command("render", stage, "b.exr", *flags, "--samples", more)
    a, b = (usdmlt.read_image(tmp_path / name) for name in ("a.exr", "b.exr"))
    assert same(a, b)


def test_resuming_a_finished_render_does_nothing_more(usdmlt_command: Run, stage, tmp_path) -> None:
    run = ["render", stage, "a.exr", *FLAGS, "--samples", 4, "--checkpoint", "c.exr", "--resume"]
    first = usdmlt_command(*run)
    assert "c.exr is not there yet" in first.stderr
    before = usdmlt.read_image(tmp_path / "a.exr"), (tmp_path / "c.exr").read_bytes()
    assert usdmlt_command(*run).returncode == 0
    assert same(usdmlt.read_image(tmp_path / "a.exr"), before[0])
    assert (tmp_path / "c.exr").read_bytes() == before[1]


def test_time_limits_say_how_to_go_on_and_do(usdmlt_command: Run, stage, tmp_path) -> None:
    flags = ["-w", 64, *CHAINS, "--mutations", 800]
    run = ["render", stage, "a.exr", *flags, "--checkpoint", "c.exr"]
    done = usdmlt_command(*run, "--time", 0.4)
    assert done.returncode == 0
    assert "c.exr has the work so far: the same with --resume goes on" in done.stderr
    runs = 0
    while "--resume goes on" in done.stderr:
        done = usdmlt_command(*run, "--time", 1.5, "--resume")
        assert done.returncode == 0, done.stderr
        runs += 1
    assert runs > 0
    usdmlt_command("render", stage, "b.exr", *flags)
    assert same(usdmlt.read_image(tmp_path / "a.exr"), usdmlt.read_image(tmp_path / "b.exr"))


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_keep_the_work(stage, tmp_path, number, status) -> None:
    process = start(stage, tmp_path, 2**20)
    time.sleep(0.5)
    process.send_signal(number)
    said = process.communicate(timeout=30)[1]
    assert process.returncode == status
    assert "--resume goes on" in said
    part = parts.read(tmp_path / "c.exr")
    assert part.state.units == [(0, int(usdmlt.read_image(tmp_path / "a.exr").metadata["units"]))]


def test_sigusr1_writes_a_checkpoint_and_goes_on(stage, tmp_path) -> None:
    process = start(stage, tmp_path, 2**20)
    seen = []
    for _ in range(2):
        time.sleep(0.3)
        process.send_signal(signal.SIGUSR1)
        wait_for(lambda: newest(tmp_path / "c.exr") not in [None, *seen])
        seen.append(newest(tmp_path / "c.exr"))
    assert process.poll() is None
    process.kill()
    process.communicate()
    old, new = (parts.read(tmp_path / name) for name in ("c.previous.exr", "c.exr"))
    assert 0 < old.state.units[0][1] < new.state.units[0][1]


def newest(path: Path) -> int | None:
    return path.stat().st_mtime_ns if path.exists() else None


def wait_for(condition: Callable[[], bool], seconds: float = 20) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def start(stage: Path, folder: Path, samples: int, *more: object) -> subprocess.Popen[str]:
    """A render in a process of its own, which has begun."""
    flags = ["-w", 64, *CHAINS, "--samples", samples, "--checkpoint", "c.exr", *more]
    process = subprocess.Popen(
        [sys.executable, "-m", "usdmlt", "render", str(stage), "a.exr", *map(str, flags)],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
        bufsize=1,
    )
    assert process.stderr is not None
    said = [process.stderr.readline(), process.stderr.readline()] if "--resume" in more else []
    said = said or [process.stderr.readline()]
    assert any("s per pixel" in line for line in said), said
    return process


def test_kills_at_any_moment_lose_no_bit(usdmlt_command: Run, stage, tmp_path) -> None:
    kill_often(usdmlt_command, stage, tmp_path, kills=5, mutations=2500)


@pytest.mark.slow
def test_fifty_kills_at_any_moment_lose_no_bit(usdmlt_command: Run, stage, tmp_path) -> None:
    kill_often(usdmlt_command, stage, tmp_path, kills=50, mutations=20000)


def kill_often(usdmlt_command: Run, stage: Path, folder: Path, kills: int, mutations: int) -> None:
    """Checkpoints are written one after the other, so that many kills meet one being written."""
    numbers = random.Random(kills)
    more = ["--checkpoint-seconds", 0.02, "--resume", "--threads", 1]
    progress = [0]
    killed = 0
    for _ in range(kills):
        process = start(stage, folder, mutations, *more)
        try:
            process.communicate(timeout=numbers.uniform(0.05, 0.5))
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            killed += 1
        if (folder / "c.exr").exists():
            progress.append(parts.read(folder / "c.exr").state.units[0][1])
    assert killed == kills, "the render was over too early to be killed that often"
    assert progress == sorted(progress) and progress[-1] > progress[0]
    flags = ["-w", 64, *CHAINS, "--samples", mutations]
    last = usdmlt_command("render", stage, "a.exr", *flags, "--checkpoint", "c.exr", "--resume")
    assert last.returncode == 0, last.stderr
    usdmlt_command("render", stage, "b.exr", *flags)
    a, b = (usdmlt.read_image(folder / name) for name in ("a.exr", "b.exr"))
    assert same(a, b)
    kept = {"a.exr", "b.exr", "c.exr", "c.previous.exr", stage.name}
    assert set(os.listdir(folder)) == kept  # nothing half-written is left behind


def test_a_new_render_does_not_write_over_a_checkpoint(
    usdmlt_command: Run, stage, tmp_path
) -> None:
    (tmp_path / "c.exr").write_bytes(b"precious")
    done = usdmlt_command("render", stage, "a.exr", "-w", 16, "--checkpoint", "c.exr")
    assert done.returncode == 1
    assert "c.exr is there already: resume it, or remove it" in done.stderr
    assert (tmp_path / "c.exr").read_bytes() == b"precious"


def test_damaged_checkpoints_are_refused_and_the_previous_one_is_named(
    usdmlt_command: Run, stage, tmp_path
) -> None:
    run = ["render", stage, "a.exr", *FLAGS, "--checkpoint", "c.exr", "--resume", "--samples"]
    for samples in (2, 4):
        assert usdmlt_command(*run, samples).returncode == 0
    path, previous = tmp_path / "c.exr", tmp_path / "c.previous.exr"
    content = path.read_bytes()
    damaged = bytearray(content)
    damaged[len(content) // 2] ^= 16
    for bad in (bytes(damaged), content[:-1000], b""):
        path.write_bytes(bad)
        done = usdmlt_command(*run, 6)
        assert done.returncode == 1
        assert len(done.stderr.splitlines()) == 1
        assert "cannot read c.exr" in done.stderr
        assert "c.previous.exr is the one before it" in done.stderr
        assert path.read_bytes() == bad
    os.replace(previous, path)
    assert usdmlt_command(*run, 6).returncode == 0
    usdmlt_command("render", stage, "b.exr", *FLAGS, "--samples", 6)
    assert same(usdmlt.read_image(tmp_path / "a.exr"), usdmlt.read_image(tmp_path / "b.exr"))


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--seed", 3], "its seed is 0, not 3"),
        (["--depth", 3], "its depth is 16, not 3"),
        (["-w", 48], "it is of another scene"),
        (["--aov", "indirect"], "it has other layers"),
        (["--mutations", 9], "its integrator is bdpt, not mlt"),
    ],
)
def test_checkpoints_of_other_renders_are_refused(
    usdmlt_command: Run, stage, flags, said, tmp_path
) -> None:
    run = ["render", stage, "a.exr", "-w", 32, "--checkpoint", "c.exr"]
    assert usdmlt_command(*run, "--samples", 2).returncode == 0
    before = (tmp_path / "c.exr").read_bytes()
    done = usdmlt_command(*run, "--resume", *flags)
    assert done.returncode == 1
    assert f"c.exr is the checkpoint of another render: {said}" in done.stderr.splitlines()[-1]
    assert (tmp_path / "c.exr").read_bytes() == before


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--resume"], "--resume needs a --checkpoint"),
        (["--checkpoint-seconds", 3], "--checkpoint-seconds needs a --checkpoint"),
        (["--checkpoint", "c.exr", "--checkpoint-seconds", 0], "must be positive"),
        (["--checkpoint", "c.exr", "--frames", "1:2"], "placeholder"),
    ],
)
def test_flags_that_make_no_sense_are_usage_errors(usdmlt_command: Run, stage, flags, said) -> None:
    output = "a.#.exr" if "--frames" in flags else "a.exr"
    done = usdmlt_command("render", stage, output, *flags)
    assert done.returncode == 2
    assert said in done.stderr


def test_a_folder_that_is_not_there_is_an_error_at_once(usdmlt_command: Run, stage) -> None:
    done = usdmlt_command("render", stage, "a.exr", "--checkpoint", "no/c.exr", "--samples", 9999)
    assert done.returncode == 1
    assert "cannot write no/c.exr: No such file or directory" in done.stderr


def test_frames_have_a_checkpoint_each(usdmlt_command: Run, stage, tmp_path) -> None:
    run = ["render", stage, "a.#.exr", "-w", 16, "--samples", 2, "--frames", "1:2"]
    done = usdmlt_command(*run, "--checkpoint", "c.#.exr")
    assert done.returncode == 0, done.stderr
    assert {p.name for p in tmp_path.glob("c.*")} == {"c.1.exr", "c.2.exr"}


# -- in Python ------------------------------------------------------------------------------------


@pytest.fixture
def rendering(stage: Path) -> usdmlt.Rendering:
    scene = usdmlt.load(stage, width=32)
    return usdmlt.Rendering(scene, usdmlt.Settings(integrator="path", samples=2000))


def test_a_checkpoint_that_cannot_be_written_is_a_warning_and_the_render_goes_on(
    rendering, tmp_path, monkeypatch, caplog
) -> None:
    settings = replace(rendering.settings, samples=20_000)  # for some seconds
    rendering = usdmlt.Rendering(rendering.scene, settings)
    checkpoint = Checkpoint(tmp_path / "c.exr", seconds=0.01)
    write = parts.write
    failures = iter([Error("cannot write c.exr: No space left on device"), MemoryError()])

    def fail_twice(*arguments, **options):
        for error in failures:
            raise error
        write(*arguments, **options)

    monkeypatch.setattr(parts, "write", fail_twice)
    assert rendering.run(checkpoint=checkpoint)
    checkpoint.write(rendering)
    warned = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert len(warned) == 2
    assert warned[0].startswith("cannot write c.exr: No space left on device; the render goes on")
    assert parts.read(tmp_path / "c.exr").state.units == [(0, 20_000)]


def test_the_previous_checkpoint_is_kept_where_there_are_no_links(
    rendering, tmp_path, monkeypatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError("no links here")

    monkeypatch.setattr(os, "link", refuse)
    checkpoint = Checkpoint(tmp_path / "c.exr")
    for until in (2, 5):
        rendering.run(until=until)
        checkpoint.write(rendering)
    read = [parts.read(path).state.units for path in (checkpoint.previous, checkpoint.path)]
    assert read == [[(0, 2)], [(0, 5)]]


def test_a_previous_checkpoint_that_cannot_be_copied_leaves_no_half_of_it(
    rendering, tmp_path, monkeypatch
) -> None:
    """Where there are no links, and the disk is full."""

    def refuse(*_: object) -> None:
        raise OSError("no links here")

    def copy_half(source: Path, target: Path) -> None:
        target.write_bytes(source.read_bytes()[:1000])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "link", refuse)
    monkeypatch.setattr("shutil.copyfile", copy_half)
    checkpoint = Checkpoint(tmp_path / "c.exr")
    rendering.run(until=2)
    checkpoint.write(rendering)
    rendering.run(until=5)
    with pytest.raises(Error, match=r"cannot write .*c\.exr: No space left on device"):
        checkpoint.write(rendering)
    assert parts.read(tmp_path / "c.exr").state.units == [(0, 2)]
    assert {path.name for path in tmp_path.glob("*c.*")} == {"c.exr"}


def test_a_checkpoint_of_which_only_the_previous_is_left_is_not_begun_anew(
    rendering, tmp_path
) -> None:
    checkpoint = Checkpoint(tmp_path / "c.exr")
    rendering.run(until=2)
    checkpoint.write(rendering)
    os.replace(checkpoint.path, checkpoint.previous)
    with pytest.raises(Error, match=r"c\.exr is not there, but .*c\.previous\.exr is"):
        checkpoint.read()


def test_large_films_are_written_less_often(rendering, tmp_path, monkeypatch) -> None:
    """Less than a hundredth of the time, unless told how often."""
    clock = [0.0]
    monkeypatch.setattr("usdmlt.checkpoint.perf_counter", lambda: clock[0])
    monkeypatch.setattr(parts, "write", lambda *_, **__: clock.__setitem__(0, clock[0] + 2))
    slow, asked = Checkpoint(tmp_path / "a.exr"), Checkpoint(tmp_path / "b.exr", seconds=7)
    assert slow.wait(0.0) == 60
    rendering.run(until=1)
    for checkpoint, pause in ((slow, 300), (asked, 7)):
        checkpoint.update(rendering)
        assert checkpoint.wait(clock[0]) == pytest.approx(pause)


def test_jumps_of_the_clock_do_not_matter(rendering, tmp_path, monkeypatch) -> None:
    """Years back or forth."""
    for now in (0.0, 4e9):
        monkeypatch.setattr(time, "time", lambda: now)  # noqa: B023
        checkpoint = Checkpoint(tmp_path / "c.exr", seconds=0.01)
        rendering.run(until=rendering.units_done + 500, checkpoint=checkpoint)
        checkpoint.write(rendering)
    assert parts.read(tmp_path / "c.exr").state.units == [(0, 1000)]


JUMPING = """
import itertools, sys, time
real, hours = time.time, itertools.cycle((0, 3, -3))
time.time = lambda: real() + 3600 * next(hours)
from usdmlt.cli import main
sys.exit(main(sys.argv[1:]))
"""


def test_time_limits_are_those_of_no_clock_that_is_set(stage, tmp_path) -> None:
    """It jumps by hours whenever it is looked at."""
    flags = ["-w", 64, *CHAINS, "--mutations", 2**20, "--time", 1.5, "--stats", "a.json"]
    flags += ["--checkpoint", "c.exr", "--checkpoint-seconds", 0.4]
    command = [sys.executable, "-c", JUMPING, "render", stage, "a.exr", *flags]
    done = subprocess.run(
        [str(word) for word in command], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert 1.5 <= json.loads((tmp_path / "a.json").read_text())["seconds"] < 10
    units = [parts.read(tmp_path / name).state.units[0][1] for name in ("c.previous.exr", "c.exr")]
    assert 0 < units[0] < units[1]


def test_render_takes_a_checkpoint_and_resumes_it(stage, tmp_path) -> None:
    path = tmp_path / "c.exr"
    usdmlt.render(stage, width=32, samples=3, checkpoint=path)
    with pytest.raises(Error, match="is there already"):
        usdmlt.render(stage, width=32, samples=3, checkpoint=path)
    more = usdmlt.render(stage, width=32, samples=5, checkpoint=path, resume=True)
    assert same(more, usdmlt.render(stage, width=32, samples=5))
    with pytest.raises(ValueError, match="name the checkpoint"):
        usdmlt.render(stage, width=32, resume=True)


def test_progress_of_a_resumed_render_tells_its_own_speed() -> None:
    from usdmlt.cli.progress import describe, remaining_seconds

    progress = usdmlt.Progress(900, 1000, 100.0, 10.0, units_before=800)
    assert remaining_seconds(progress, None) == pytest.approx(10.0)
    assert describe(progress, None).startswith("1 k samples/s")
