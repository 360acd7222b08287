"""`usdmlt bench`: small tables of both kinds."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from usdmlt import benchmark
from usdmlt.stage import load

CORNELL_BOX = Path(__file__).parents[2] / "scenes/cornell_box.usda"
Run = Callable[..., "subprocess.CompletedProcess[str]"]


def test_rates_of_every_integrator_are_printed_and_written(
    usdmlt_command: Run, tmp_path: Path
) -> None:
    table = tmp_path / "speed.json"
    done = usdmlt_command(
        "bench", CORNELL_BOX, "-w", 32, "--samples", 8, "--depth", 4, "--no-mitsuba",
        "--json", table,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    rows = {row["renderer"]: row for row in json.loads(table.read_text())["cornell_box"]}
    assert list(rows) == ["path", "bdpt", "mlt"]
    for name, row in rows.items():
        assert f"\n{name}" in done.stdout
        assert row["samples_per_second"] > 0
        assert 0 < row["rays_per_second"] < row["embree_rays_per_second"]
        assert abs(row["mean"] / rows["path"]["mean"] - 1) < 0.1, "not the same picture"


def test_errors_in_equal_time_are_printed_and_written(usdmlt_command: Run, tmp_path: Path) -> None:
    table = tmp_path / "errors.json"
    done = usdmlt_command(
        "bench", CORNELL_BOX, "-w", 32, "--depth", 4, "--equal-time", 0.04, "--reference-time", 1,
        "--seeds", 3, "--json", table,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    reference, *rows = json.loads(table.read_text())["cornell_box"]
    assert reference["reference"] in ("bdpt", "mlt")
    assert f"reference: {reference['reference']}" in done.stdout
    assert [row["integrator"] for row in rows] == ["path", "bdpt", "mlt", "auto"]
    for row in rows:
        assert f"\n{row['integrator']}" in done.stdout
        assert row["chosen"] in ("path", "bdpt", "mlt")
        assert (row["b_spread"] is not None) == (row["chosen"] == "mlt")
        assert abs(row["mean_ratio"] - 1) < 0.2


def test_a_picture_without_light_has_no_errors_to_compare(usdmlt_command: Run, stage: Path) -> None:
    stage.write_text(stage.read_text().replace("inputs:intensity = 3", "inputs:intensity = 0"))
    done = usdmlt_command("bench", stage, "-w", 16, "--equal-time", 0.01, "--seeds", 2)
    assert done.returncode == 1
    assert "no light was found" in done.stderr


def test_what_cannot_be_measured_is_refused(usdmlt_command: Run, stage: Path) -> None:
    for options, complaint in (
        (("--equal-time", 0), "time must be a positive number"),
        (("--equal-time", 1, "--reference-time", -1), "time must be a positive number"),
        (("--equal-time", 1, "--seeds", 1), "two of them at least"),
        (("--integrators", "path,sppm"), "unknown integrator 'sppm'"),
        (("--integrators", "auto"), "unknown integrator 'auto'"),
    ):
        done = usdmlt_command("bench", stage, *options)
        assert done.returncode == 2, options
        assert complaint in done.stderr
        assert len(done.stderr.splitlines()) == 1


def test_a_renderer_that_ends_its_process_does_not_end_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a compiler does that does not know the processor."""
    (tmp_path / "mitsuba.py").write_text(
        "import os\n"
        "def set_variant(name):\n"
        "    os.write(2, b'cannot select\\nmore')\n"
        "    os.abort()\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mitsuba", raising=False)
    told = list(benchmark.measure_mitsuba(load(CORNELL_BOX, width=8), samples=1, depth=2))
    assert told == [
        f"Mitsuba 3 {variant} does not run here: cannot select"
        for variant in ("scalar_rgb", "llvm_ad_rgb")
    ]
