"""Bad input: one line on stderr, the right exit status, and nothing half-written."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def assert_one_line(done: subprocess.CompletedProcess[str], status: int, says: str) -> None:
    assert done.returncode == status, done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert says in lines[0]
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (["--samples", 0], "samples must be between 1 and"),
        (["--samples", "many"], "argument --samples: invalid int value: 'many'"),
        (["--depth", 0], "depth must be between 1 and"),
        (["--seed", -1], "seed must be between 0 and"),
        (["--threads", 0], "threads must be between 1 and"),
        (["--time", 0], "time must be a positive number"),
        (["--imageWidth", 0], "width must be between 1 and"),
        (["--res", 16, 0], "height must be between 1 and"),
        (["--res", 16, 9, "-w", 16], "not allowed with argument"),
        (["--mutations", 0], "mutations must be between 1 and"),
        (["--mutations", "many"], "argument --mutations: invalid int value: 'many'"),
        (["--mutations", 8, "--samples", 8], "samples and mutations say the same"),
        (["--mutations", 8, "--integrator", "bdpt"], "mutations are for mlt, not for bdpt"),
        (["--mutation-weights", "lenz=1"], "unknown mutation 'lenz'"),
        (["--mutation-weights", "lens"], "'lens' is not NAME=WEIGHT"),
        (["--mutation-weights", ""], "'' is not NAME=WEIGHT"),
        (["--mutation-weights", "new_path=1,new_path=2"], "two weights for new_path"),
        (["--mutation-weights", "new_path=-1"], "must be finite and not negative"),
        (["--mutation-weights", "new_path=nan"], "must be finite and not negative"),
        (["--mutation-weights", "new_path=0"], "must not all be zero"),
        (["--mutation-weights", "lens=1"], "add new_path or bidirectional"),
        (["--direct", "both"], "argument --direct: invalid choice"),
        (["--integrator", "mlt", "--depth", 0], "depth must be between 1 and"),
        (["--integrator", "mlt9"], "argument --integrator: invalid choice"),
        (["--frames", "1:x"], "is not start[:end[xstride]]"),
        (["--frames", "1:3"], "needs one placeholder"),
        (["--nonsense"], "unrecognized arguments: --nonsense"),
    ],
)
def test_wrong_flags_and_values_exit_with_2(
    usdmlt_command: Run, stage: Path, tmp_path: Path, flags: list[object], says: str
) -> None:
    done = usdmlt_command("render", stage, "a.exr", *flags)
    assert_one_line(done, 2, says)
    assert not (tmp_path / "a.exr").exists()


def test_an_unknown_extension_exits_with_2(usdmlt_command: Run, stage: Path) -> None:
    assert_one_line(usdmlt_command("render", stage, "a.tiff"), 2, ".exr, .png, .jpg or")


def test_a_subcommand_is_needed(usdmlt_command: Run) -> None:
    assert_one_line(usdmlt_command(), 2, "the following arguments are required: COMMAND")


def test_a_missing_stage_exits_with_1(usdmlt_command: Run) -> None:
    assert_one_line(usdmlt_command("render", "none.usda", "a.exr"), 1, "none.usda")


def test_a_file_that_is_not_usd_exits_with_1(usdmlt_command: Run, tmp_path: Path) -> None:
    (tmp_path / "text.usda").write_text("this is not USD\n")
    assert_one_line(usdmlt_command("render", "text.usda", "a.exr"), 1, "text.usda")
    assert not (tmp_path / "a.exr").exists()


def test_a_missing_camera_exits_with_1_and_is_named(usdmlt_command: Run, stage: Path) -> None:
    done = usdmlt_command("render", stage, "a.exr", "--camera", "/World/none")
    assert_one_line(done, 1, "/World/none")


@pytest.mark.parametrize(
    "output",
    ["none/a.exr", "panel.usda/a.exr", "directory.exr"],
    ids=["no such directory", "a file for a directory", "a directory for a file"],
)
def test_an_unwritable_output_exits_with_1_before_rendering(
    usdmlt_command: Run, stage: Path, tmp_path: Path, output: str
) -> None:
    (tmp_path / "directory.exr").mkdir()
    before = sorted(os.listdir(tmp_path))
    # With as many samples as this the test would time out if it rendered first.
    done = usdmlt_command("render", stage, output, "--samples", 2**20)
    assert_one_line(done, 1, f"cannot write {output}")
    assert sorted(os.listdir(tmp_path)) == before


def test_an_unwritable_stats_file_exits_with_1_before_rendering(
    usdmlt_command: Run, stage: Path, tmp_path: Path
) -> None:
    done = usdmlt_command("render", stage, "a.exr", "--stats", "none/a.json", "--samples", 2**20)
    assert_one_line(done, 1, "cannot write none/a.json")
    assert not (tmp_path / "a.exr").exists()


def test_inspect_of_a_missing_stage_exits_with_1(usdmlt_command: Run) -> None:
    assert_one_line(usdmlt_command("inspect", "none.usda"), 1, "none.usda")
