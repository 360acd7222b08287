"""Several frames as one job: one that fails does not take the others along."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., "subprocess.CompletedProcess[str]"]
FLAGS = ["-w", 16, "--samples", 1, "--frames", "1:3"]


@pytest.fixture
def broken(stage: Path) -> Path:
    """A stage whose second frame cannot be rendered: its camera is turned inside out."""
    text = stage.read_text()
    moved = "double3 xformOp:translate.timeSamples = {1: (0, 0, 4), 2: (nan, 0, 4), 3: (0, 0, 4)}"
    broken = stage.with_name("broken.usda")
    broken.write_text(text.replace("double3 xformOp:translate = (0, 0, 4)", moved))
    return broken


@pytest.mark.parametrize("where", [[], ["--workers", 2]])
def test_a_frame_that_fails_is_told_and_the_others_are_written(
    usdmlt_command: Run, broken, tmp_path, where
) -> None:
    if where:
        pytest.importorskip("distributed")
    done = usdmlt_command("render", broken, "a.#.exr", *FLAGS, *where)
    assert done.returncode == 1, done.stderr
    lines = done.stderr.splitlines()
    assert any(
        line.startswith("usdmlt: a.2.exr failed: ") or "a.2.exr failed" in line for line in lines
    )
    assert lines[-1] == "usdmlt: error: 2 of 3 pictures were written, not a.2.exr"
    assert {p.name for p in tmp_path.glob("*.exr")} == {"a.1.exr", "a.3.exr"}


def test_a_single_frame_fails_as_before(usdmlt_command: Run, broken) -> None:
    done = usdmlt_command("render", broken, "a.#.exr", "-w", 16, "--frames", "2")
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "/World/main_cam" in done.stderr


def test_frames_that_are_there_are_left_out(usdmlt_command: Run, stage, tmp_path) -> None:
    (tmp_path / "a.2.exr").write_bytes(b"there")
    (tmp_path / "a.3.exr").write_bytes(b"")  # of a render that was killed
    done = usdmlt_command("render", stage, "a.#.exr", *FLAGS, "--skip-existing")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.2.exr").read_bytes() == b"there"
    assert os.path.getsize(tmp_path / "a.3.exr") > 1000
    assert "a.2.exr is there already: left out" in done.stderr
