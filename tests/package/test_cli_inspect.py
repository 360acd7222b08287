"""`usdmlt inspect`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def test_what_would_be_rendered_is_listed(usdmlt_command: Run, stage: Path) -> None:
    done = usdmlt_command("inspect", stage, "-w", 64)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"{stage}" in done.stdout
    assert "camera     /World/main_cam" in done.stdout
    assert "picture    64x32" in done.stdout
    assert "1 meshes, 2 triangles" in done.stdout
    assert "1 RectLight" in done.stdout
    assert "warnings   none" in done.stdout


def test_what_would_not_be_is_named_by_prim_and_all_of_it_on_request(
    usdmlt_command: Run, tmp_path: Path
) -> None:
    patches = "\n".join(f'def NurbsPatch "Patch{i}" {{ }}' for i in range(9))
    (tmp_path / "patches.usda").write_text(f"#usda 1.0\n{patches}\n")
    brief = usdmlt_command("inspect", "patches.usda")
    assert brief.returncode == 0, brief.stderr
    assert "warning " in brief.stdout
    assert "/Patch0" in brief.stdout
    assert "/Patch8" not in brief.stdout
    assert "/Patch8" in usdmlt_command("inspect", "patches.usda", "-v").stdout


@pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_leaves_early_is_no_error(stage: Path, unbuffered: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "usdmlt", "inspect", str(stage)]
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, env=environment)
    os.close(writer)
    assert done.stderr == b""
