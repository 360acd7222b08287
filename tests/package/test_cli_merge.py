"""`usdmlt merge`: chunks of a render are the render, and what is no whole is refused."""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt import parts

Run = Callable[..., "subprocess.CompletedProcess[str]"]
FLAGS = ["-w", 80, "--aov", "lightGroups,N,P,CryptoObject,objectId,sampleCount", "--seed", 4]
WORK = {
    "mlt": ["--integrator", "mlt", "--direct", "mlt", "--samples", 100],
    "bdpt": ["--integrator", "bdpt", "--samples", 6],
    "path": ["--integrator", "path", "--samples", 6],
    "auto": ["--samples", 6],
}
TOLD_OTHERWISE = ("date", "time")


def assert_same(a: Path, b: Path) -> None:
    """The same channels of the same bits, and the same making."""
    first, second = usdmlt.read_image(a), usdmlt.read_image(b)
    assert list(first.channels) == list(second.channels)
    for name, pixels in first.channels.items():
        np.testing.assert_array_equal(second[name], pixels, err_msg=name)
    told = [
        {n: v for n, v in i.metadata.items() if n not in TOLD_OTHERWISE} for i in (first, second)
    ]
    assert told[0] == told[1]


@pytest.fixture
def chunks(stage: Path, tmp_path: Path) -> Callable[[str], list[str]]:
    """Eight chunks of a render by as many processes, in random order, two at a time."""

    def render(integrator: str) -> list[str]:
        names = [f"part{number}.exr" for number in range(8)]
        order = list(range(8))
        random.Random(integrator).shuffle(order)
        for pair in zip(order[::2], order[1::2], strict=True):
            processes = [
                subprocess.Popen(
                    [sys.executable, "-m", "usdmlt", "render", str(stage), names[number], "-q"]
                    + [str(f) for f in (*FLAGS, *WORK[integrator], "--units", f"{number}/8")],
                    cwd=tmp_path,
                )
                for number in pair
            ]
            assert [process.wait(60) for process in processes] == [0, 0]
        random.Random(integrator).shuffle(names)
        return names

    return render


@pytest.mark.parametrize("integrator", ["mlt", "bdpt", "auto"])
def test_eight_chunks_in_any_order_are_one_render(
    usdmlt_command: Run, stage, tmp_path, chunks, integrator
) -> None:
    names = chunks(integrator)
    merged = usdmlt_command("merge", *names, "-o", "merged.exr")
    assert merged.returncode == 0, merged.stderr
    assert merged.stderr.startswith("wrote merged.exr: units 0:")
    whole = usdmlt_command("render", stage, "whole.exr", *FLAGS, *WORK[integrator])
    assert whole.returncode == 0, whole.stderr
    assert_same(tmp_path / "merged.exr", tmp_path / "whole.exr")

    missing = parts.read(tmp_path / names[3]).state.units[0]
    refused = usdmlt_command("merge", *names[:3], *names[4:], "-o", "gap.exr")
    assert refused.returncode == 1
    assert f"units {missing[0]}:{missing[1]} of 0:" in refused.stderr
    assert not (tmp_path / "gap.exr").exists()


def test_gaps_are_allowed_if_that_is_asked_for(
    usdmlt_command: Run, tmp_path, chunks, stage
) -> None:
    """The mean of what is there: its light is that of the whole, within its noise."""
    names = chunks("bdpt")
    done = usdmlt_command("merge", *names[:2], *names[3:], "-o", "gap.exr", "--allow-gaps")
    assert done.returncode == 0
    assert "are missing: the picture is of the others" in done.stderr
    gap = usdmlt.read_image(tmp_path / "gap.exr")
    usdmlt_command("render", stage, "whole.exr", *FLAGS, *WORK["bdpt"])
    whole = usdmlt.read_image(tmp_path / "whole.exr")
    assert gap["color"].mean() == pytest.approx(whole["color"].mean(), rel=0.05)
    assert "settings" not in gap.metadata  # it cannot be made again by a number of units
    again = usdmlt_command("render", "--from", "gap.exr")
    assert again.returncode == 1 and "does not say how" in again.stderr


def test_a_merged_picture_says_how_to_make_it_again(
    usdmlt_command: Run, tmp_path, chunks, stage
) -> None:
    names = chunks("mlt")
    usdmlt_command("merge", *names, "-o", "merged.exr")
    done = usdmlt_command("render", "--from", "merged.exr", "again.exr")
    assert done.returncode == 0, done.stderr
    assert_same(tmp_path / "merged.exr", tmp_path / "again.exr")


def test_parts_can_be_merged_to_parts_and_resumed(
    usdmlt_command: Run, tmp_path, chunks, stage
) -> None:
    names = chunks("path")
    assert usdmlt_command("merge", *names[:3], "-o", "a.exr", "--part").returncode == 0
    assert usdmlt_command("merge", *names[3:7], "-o", "b.exr", "--part").returncode == 0
    merged = usdmlt_command("merge", "b.exr", "a.exr", names[7], "-o", "merged.exr")
    assert merged.returncode == 0, merged.stderr
    flags = [*FLAGS, *WORK["path"]]
    resumed = usdmlt_command(
        "render", stage, "resumed.exr", *flags, "--checkpoint", "b.exr", "--resume"
    )
    assert resumed.returncode == 0, resumed.stderr
    usdmlt_command("render", stage, "whole.exr", *flags)
    assert_same(tmp_path / "merged.exr", tmp_path / "whole.exr")
    assert_same(tmp_path / "resumed.exr", tmp_path / "whole.exr")


def test_what_does_not_belong_together_is_refused(usdmlt_command: Run, stage, tmp_path) -> None:
    run = ["render", stage]
    flags = ["-w", 16, "--samples", 4, "--integrator", "path"]
    for name, more in (
        ("a", ["--units", "0:2"]),
        ("b", ["--units", "1:4"]),
        ("c", ["--units", "2:4", "--seed", 1]),
    ):
        done = usdmlt_command(*run, f"{name}.exr", *flags, *more)
        assert done.returncode == 0, done.stderr
    twice = usdmlt_command("merge", "a.exr", "b.exr", "-o", "out.exr", "--allow-gaps")
    assert twice.returncode == 1
    assert "units 1:2 are in a.exr and in b.exr" in twice.stderr
    other = usdmlt_command("merge", "a.exr", "c.exr", "-o", "out.exr", "--allow-gaps")
    assert other.returncode == 1
    assert "c.exr and a.exr are of different renders: its seed is 1, not 0" in other.stderr
    usdmlt_command(*run, "picture.exr", *flags)
    picture = usdmlt_command("merge", "a.exr", "picture.exr", "-o", "out.exr")
    assert picture.returncode == 1
    assert "picture.exr: it ends too early, or is a picture only" in picture.stderr
    assert not (tmp_path / "out.exr").exists()


def test_a_view_is_made_of_parts(usdmlt_command: Run, stage, tmp_path) -> None:
    flags = ["-w", 16, "--samples", 2, "--integrator", "path"]
    for number in (0, 1):
        usdmlt_command("render", stage, f"{number}.exr", *flags, "--units", f"{number}/2")
    assert usdmlt_command("merge", "0.exr", "1.exr", "-o", "a.png").returncode == 0
    usdmlt_command("render", stage, "b.png", *flags)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("output", "flags", "said"),
    [
        ("a.exr", ["--units", "0:999999"], "the render has 2 units, 0:2"),
        ("a.exr", ["--units", "x"], "neither A:B"),
        ("a.png", ["--units", "0:1"], "need an OUTPUT.exr"),
        ("a.exr", ["--units", "0:1", "--error", 0.1], "--error is of a whole picture"),
    ],
)
def test_chunks_that_cannot_be_are_usage_errors(
    usdmlt_command: Run, stage, output, flags, said
) -> None:
    done = usdmlt_command("render", stage, output, "-w", 16, "--samples", 2, *flags)
    assert done.returncode == 2
    assert said in done.stderr
