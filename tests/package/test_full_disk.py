"""Disks that are full: the work is not lost, what was there stays, and nothing half-written does.

A full disk is a small file system in memory, for which one has to be root, and where that is not to
be had, or besides, a limit of the size of files, which the system enforces in the same way.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt import parts

resource = pytest.importorskip("resource", reason="limits the size of files as POSIX does")

FLAGS = ["-w", 64, "--integrator", "mlt", "--direct", "mlt", "--threads", 1]


class Disk:
    """A folder in which there is room for so many bytes, and no more once :meth:`fill` was called.

    ``reason``: what the system says then.
    """

    def __init__(self, folder: Path, reason: str, limited: bool) -> None:
        self.folder, self.reason = folder, reason
        self._limited = limited
        self._room: int | None = None

    def leave(self, room: int) -> None:
        """From now on."""
        self._room = room
        if not self._limited:
            there = os.statvfs(self.folder)
            (self.folder / "filler").write_bytes(bytes(there.f_bavail * there.f_frsize - room))

    def run(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        """`usdmlt` with these arguments, above the folder."""

        def limit() -> None:
            if self._limited and self._room is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (self._room, resource.RLIM_INFINITY))

        return subprocess.run(
            [sys.executable, "-m", "usdmlt", *map(str, arguments)],
            cwd=self.folder.parent,
            capture_output=True,
            text=True,
            timeout=120,
            preexec_fn=limit,
        )

    @property
    def names(self) -> set[str]:
        """Of the files there."""
        return set(os.listdir(self.folder)) - {"filler"}


@pytest.fixture(params=["file system", "size of files"])
def disk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Disk]:
    folder = tmp_path / "disk"
    folder.mkdir()
    if request.param == "size of files":
        yield Disk(folder, "File too large", limited=True)
        return
    yield from mounted(folder)


@pytest.fixture
def real_disk(tmp_path: Path) -> Iterator[Disk]:
    folder = tmp_path / "disk"
    folder.mkdir()
    yield from mounted(folder)


def mounted(folder: Path) -> Iterator[Disk]:
    command = ["mount", "-t", "tmpfs", "-o", "size=4m", "usdmlt-test", str(folder)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no file system can be mounted here")
    yield Disk(folder, "No space left on device", limited=False)
    subprocess.run(["umount", str(folder)], check=True)


def test_a_checkpoint_that_has_no_room_leaves_the_one_before_and_the_picture_is_written(
    disk: Disk, stage: Path
) -> None:
    run = ["render", stage, "a.exr", *FLAGS, "--checkpoint", "disk/c.exr", "--samples"]
    assert disk.run(*run, 100).returncode == 0
    before = (disk.folder / "c.exr").read_bytes()
    disk.leave(len(before) // 2)
    more = ["--resume", "--checkpoint-seconds", 0.1]
    done = disk.run(*run, 400, *more)
    said = f"cannot write disk/c.exr: {disk.reason}"
    assert done.returncode == 1, done.stderr
    assert done.stderr.splitlines()[-1] == f"usdmlt: error: {said}"
    assert done.stderr.count(f"warning: {said}; the render goes on, and tries again") == 1
    assert disk.names == {"c.exr"}
    assert (disk.folder / "c.exr").read_bytes() == before
    assert parts.read(disk.folder / "c.exr").state.units[0][1] > 0
    assert disk.run("render", stage, "b.exr", *FLAGS, "--samples", 400).returncode == 0
    a, b = (usdmlt.read_image(stage.with_name(name)) for name in ("a.exr", "b.exr"))
    np.testing.assert_array_equal(a["color"], b["color"])


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.jpg"])
def test_a_picture_that_has_no_room_is_an_error_and_nothing_is_left(
    disk: Disk, stage: Path, name: str
) -> None:
    disk.leave(100)
    done = disk.run("render", stage, f"disk/{name}", *FLAGS, "--samples", 10)
    fails(done, f"cannot write disk/{name}: {disk.reason}")
    assert disk.names == set()


def test_a_part_that_has_no_room_is_an_error_and_nothing_is_left(disk: Disk, stage: Path) -> None:
    disk.leave(1000)
    flags = [*FLAGS, "--samples", 100, "--units", "0/2"]
    fails(disk.run("render", stage, "disk/a.exr", *flags), f"write disk/a.exr: {disk.reason}")
    assert disk.names == set()


def test_a_merged_picture_and_part_that_have_no_room_are_errors(disk: Disk, stage: Path) -> None:
    assert disk.run("render", stage, "a.exr", *FLAGS, "--units", "0:1").returncode == 0
    disk.leave(1000)
    for flag in ("--part", "--allow-gaps"):
        done = disk.run("merge", "a.exr", "-o", "disk/b.exr", flag)
        fails(done, f"cannot write disk/b.exr: {disk.reason}")
    assert disk.names == set()


def test_a_picture_without_room_is_made_of_its_checkpoint_when_there_is(
    real_disk: Disk, stage: Path
) -> None:
    real_disk.leave(100)
    run = ["render", stage, "disk/a.exr", *FLAGS, "--samples", 10, "--checkpoint", "c.exr"]
    reason = f"cannot write disk/a.exr: {real_disk.reason}"
    fails(real_disk.run(*run), f"{reason}; c.exr has the work, to --resume")
    (real_disk.folder / "filler").unlink()
    assert real_disk.run(*run, "--resume").returncode == 0
    assert real_disk.names == {"a.exr"}
    real_disk.run("render", stage, "b.exr", *FLAGS, "--samples", 10)
    a, b = (usdmlt.read_image(stage.parent / name) for name in ("disk/a.exr", "b.exr"))
    np.testing.assert_array_equal(a["color"], b["color"])


def test_a_snapshot_that_has_no_room_is_a_warning(real_disk: Disk, stage: Path) -> None:
    real_disk.leave(100)
    flags = [*FLAGS, "--samples", 300, "--snapshot", 0.1, "--checkpoint", "c.exr"]
    done = real_disk.run("render", stage, "disk/a.exr", *flags)
    said = f"usdmlt: warning: cannot write disk/a_snapshot.exr: {real_disk.reason}; the render goes"
    assert done.stderr.count(said) == 1, done.stderr
    assert "c.exr has the work, to --resume" in done.stderr.splitlines()[-1]
    assert real_disk.names == set()


@pytest.mark.parametrize(
    "flags",
    [
        ["--stats", "disk/a.json"],
        ["--traceToFile", "disk/a.json"],
        ["--traceToFile", "disk/a.json", "--traceFormat", "trace"],
    ],
)
def test_statistics_and_traces_that_have_no_room_do_not_take_the_picture_along(
    real_disk: Disk, stage: Path, flags: list[str]
) -> None:
    real_disk.leave(0)
    done = real_disk.run("render", stage, "a.exr", "-w", 8, "--samples", 1, *flags)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("usdmlt: error: cannot write disk/a.json: No sp")
    assert "wrote a.exr" in done.stderr
    assert usdmlt.read_image(stage.with_name("a.exr")).width == 8
    assert real_disk.names == set()


def test_a_report_that_has_no_room_is_an_error(real_disk: Disk, stage: Path) -> None:
    for seed, name in enumerate(("a.exr", "b.exr")):
        real_disk.run("render", stage, name, "-w", 16, "--samples", 4, "--seed", seed)
    real_disk.leave(1000)
    said = f"cannot write disk/c.html: {real_disk.reason}"
    fails(real_disk.run("compare", "a.exr", "b.exr", "--report", "disk/c.html"), said, status=2)
    fails(real_disk.run("view", "a.exr", "-o", "disk/c.html"), said)
    assert real_disk.names == set()


def test_in_python_a_checkpoint_that_has_no_room_does_not_take_the_picture_along(
    real_disk: Disk, stage: Path, caplog: pytest.LogCaptureFixture
) -> None:
    real_disk.leave(1000)
    path = real_disk.folder / "c.exr"
    image = usdmlt.render(stage, width=32, samples=3, checkpoint=path)
    np.testing.assert_array_equal(
        image["color"], usdmlt.render(stage, width=32, samples=3)["color"]
    )
    assert f"cannot write {path}: No space left on device" in caplog.text
    assert real_disk.names == set()


def fails(done: subprocess.CompletedProcess[str], said: str, status: int = 1) -> None:
    assert done.returncode == status, done.stderr
    assert said in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
