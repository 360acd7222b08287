"""What is shown while it renders: snapshots, and what happens when that fails."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest

import usdmlt
from usdmlt import Error, Image, Rendering, Settings, previews, read_image
from usdmlt.cli import main
from usdmlt.cli.pictures import snapshot_path
from usdmlt.previews import Preview

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(previews, "FIRST_SECONDS", 0.0)


def rendering(**settings: object) -> Rendering:
    scene = usdmlt.load(SCENE, width=32)
    return Rendering(scene, Settings(integrator="path", depth=4, **settings))  # type: ignore[arg-type]


def test_pictures_that_are_shown_grow_and_the_last_bits_stay_the_same() -> None:
    shown: list[Image] = []
    watched, alone = rendering(samples=3000), rendering(samples=3000)
    assert watched.run(previews=[Preview(shown.append, 0.01)])
    assert alone.run()
    units = [image.stats["units_done"] for image in shown]
    assert len(units) >= 3 and units == sorted(set(units)) and units[0] > 0
    assert units[-1] < watched.units_total
    np.testing.assert_array_equal(watched.image()["color"], alone.image()["color"])
    part = rendering(samples=3000)
    part.run(until=units[0])
    np.testing.assert_array_equal(shown[0]["color"], part.image()["color"])


class Noting:
    """A core render that notes the deadlines it is run with."""

    def __init__(self, render: Any) -> None:
        self.render = render
        self.deadlines: list[float] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.render, name)

    def run(self, *arguments: Any, deadline_seconds: float, **more: Any) -> None:
        self.deadlines.append(deadline_seconds)
        self.render.run(*arguments, deadline_seconds=deadline_seconds, **more)


def test_previews_do_not_count_as_time_of_rendering() -> None:
    """After each, what is left of the time is the limit less the rendering before it, at most."""
    watched = rendering(time=0.5)
    watched._render = noting = Noting(watched._render)
    shown: list[float] = []

    def show(image: Image) -> None:
        shown.append(image.stats["seconds"])
        sleep(0.3)

    watched.run(previews=[Preview(show, 0.1)])
    assert shown and noting.deadlines[0] == 0.5
    for deadline, seconds in zip(noting.deadlines[1:], shown, strict=True):
        assert 0 < deadline < 0.5 - seconds + 1e-3


def test_a_preview_that_fails_is_one_warning_and_the_render_goes_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    calls = []

    def fail(image: Image) -> None:
        calls.append(image)
        raise Error("no paper")

    watched = rendering(samples=300)
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        assert watched.run(previews=[Preview(fail, 0.01)])
    assert len(calls) == 1
    messages = [record.getMessage() for record in caplog.records]
    assert messages == ["no paper; the render goes on without it"]


def test_ctrl_c_ends_a_render_that_is_watched() -> None:
    watched = rendering(samples=100_000)
    shown: list[Image] = []
    assert not watched.run(stop=lambda: len(shown) >= 2, previews=[Preview(shown.append, 0.01)])
    assert 0 < watched.units_done < watched.units_total


@pytest.mark.parametrize("seconds", [0, -1, float("nan"), float("inf")])
def test_the_seconds_between_previews_are_positive(seconds: float) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        Preview(print, seconds)


def test_render_takes_a_preview(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Image] = []
    image = usdmlt.render(
        SCENE, width=32, integrator="path", samples=3000, depth=4,
        preview=shown.append, preview_seconds=0.01,
    )  # fmt: skip
    assert len(shown) >= 3
    np.testing.assert_array_equal(shown[-1]["color"], image["color"])  # the last is the whole one


def test_a_snapshot_is_there_during_the_render_and_gone_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    write = Image.write

    def noting(image: Image, path: str | Path, *arguments: object, **how: object) -> None:
        write(image, path, *arguments, **how)  # type: ignore[arg-type]
        seen.append((Path(path).name, read_image(path).metadata["units"]))

    monkeypatch.setattr(Image, "write", noting)
    output = str(tmp_path / "a.exr")
    flags = ["-w", "32", "--integrator", "path", "--samples", "3000", "--snapshot", "0.01"]
    assert main(["render", str(SCENE), output, "--depth", "4", *flags]) == 0
    assert {name for name, _ in seen[:-1]} == {"a_snapshot.exr"} and len(seen) > 2
    assert seen[-1][0] == "a.exr" and seen[-1][1] > seen[0][1]
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


def test_a_snapshot_is_no_frame_of_the_sequence() -> None:
    assert str(snapshot_path("x/shot.0101.exr")) == "x/shot_snapshot.0101.exr"
    assert str(snapshot_path("shot.png")) == "shot_snapshot.png"


def test_progress_for_programs_is_on_stdout(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["render", str(SCENE), str(tmp_path / "a.exr"), "-w", "32", "--samples", "50"]
    assert main([*command, "--integrator", "path", "--progress", "json", "-q"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[-1]["fraction"] == 1 and lines[-1]["units_done"] == lines[-1]["units_total"]
    assert lines[-1]["samples"] >= 50 * 32 * 32 and lines[-1]["remaining_seconds"] == 0
    assert main([*command, "--integrator", "path", "--progress", "alfred", "-q"]) == 0
    said = capsys.readouterr()
    percents = [int(line.removeprefix("ALF_PROGRESS ")[:-1]) for line in said.out.splitlines()]
    assert percents == sorted(set(percents)) and percents[-1] == 100
    assert said.err == ""
    assert main([*command, "--integrator", "path", "--progress", "plain"]) == 0
    assert capsys.readouterr().out == ""
