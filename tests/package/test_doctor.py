"""`usdmlt doctor`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from usdmlt import __version__

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def test_a_whole_installation_is_healthy(usdmlt_command: Run) -> None:
    done = usdmlt_command("doctor")
    assert done.returncode == 0, done.stdout
    rows = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    assert rows["usdmlt"] == __version__
    assert rows["Embree"].startswith("4.")
    assert rows["threads"].split()[0] == str(len(os.sched_getaffinity(0)))
    assert "MISSING" not in done.stdout


def test_what_is_missing_is_named_and_the_status_is_1(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "usdmlt", "doctor"]
    environment = {**os.environ, "USDMLT_EMBREE": str(tmp_path / "libembree4.so")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "MISSING: USDMLT_EMBREE names" in done.stdout


def test_a_library_that_is_not_embree_is_refused(tmp_path: Path) -> None:
    (tmp_path / "libembree4.so").write_text("not a library")
    command = [sys.executable, "-m", "usdmlt", "doctor"]
    environment = {**os.environ, "USDMLT_EMBREE": str(tmp_path / "libembree4.so")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "MISSING" in done.stdout
    assert "Traceback" not in done.stderr


def test_the_version(usdmlt_command: Run) -> None:
    done = usdmlt_command("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"usdmlt {__version__}\n", "")
