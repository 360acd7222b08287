"""`usdmlt render`: what it writes and what it says."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from usdmlt import __version__, read_image

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def test_an_exr_with_its_making_is_written(
    usdmlt_command: Run, stage: Path, tmp_path: Path
) -> None:
    done = usdmlt_command(
        "render", stage, "a.exr", "-w", 64, "--samples", 4, "--seed", 9, "--frames", "2"
    )
    assert done.returncode == 2  # a frame needs a placeholder
    done = usdmlt_command(
        "render", stage, "a.#.exr", "-w", 64, "--samples", 4, "--seed", 9, "--frames", "2"
    )
    assert done.returncode == 0, done.stderr
    spec = oiio.ImageInput.open(str(tmp_path / "a.2.exr")).spec()
    assert (spec.width, spec.height) == (64, 32)
    assert spec.channelnames == ("R", "G", "B", "A", "error.Y")
    assert spec.getattribute("renderer") == f"usdmlt {__version__}"
    assert Path(spec.getattribute("usdmlt:stage")).name == stage.name
    assert spec.getattribute("usdmlt:camera") == "/World/main_cam"
    assert spec.getattribute("usdmlt:frame") == 2
    assert spec.getattribute("usdmlt:seed") == 9
    assert spec.getattribute("usdmlt:samples") == 4
    assert spec.getattribute("usdmlt:integrator") == "bdpt"
    assert spec.getattribute("usdmlt:time") > 0
    assert sorted(os.listdir(tmp_path)) == ["a.2.exr", stage.name]


def test_world_to_ndc_takes_the_panels_corner_to_where_it_is_seen(
    usdmlt_command: Run, stage: Path, tmp_path: Path
) -> None:
    """The camera at z = 4 sees x from -2 to 2 and y from -1 to 1 at the panel: it fills the
    middle half of the width and all of the height."""
    usdmlt_command("render", stage, "a.exr", "-w", 64, "--samples", 4)
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    to_ndc = np.array(spec.getattribute("worldToNDC")).reshape(4, 4)
    for corner, expected in (((-1, 1, 0), (0.25, 0)), ((1, -1, 0), (0.75, 1))):
        x, y, _, w = np.array([*corner, 1]) @ to_ndc
        np.testing.assert_allclose((x / w, y / w), expected, atol=1e-6)
    alpha = read_image(tmp_path / "a.exr")["alpha"]
    assert (alpha[2:-2, 20:44] > 0.99).all()
    assert (alpha[:, :12] == 0).all()


def test_what_was_chosen_and_written_is_said_in_two_lines(usdmlt_command: Run, stage: Path) -> None:
    done = usdmlt_command("render", stage, "a.exr", "-w", 32, "--samples", 3)
    assert done.stdout == ""
    chosen, written = done.stderr.splitlines()
    for default in (
        "/World/main_cam",
        "32x16",
        "bdpt (auto: the render is too short to try others)",
        "3 samples per pixel",
        "depth 16",
        "seed 0",
    ):
        assert default in chosen
    assert written.startswith("wrote a.exr: 3 samples per pixel")


def test_mlt_says_and_writes_how_many_mutations_there_were(
    usdmlt_command: Run, stage: Path, tmp_path: Path
) -> None:
    flags = ["--integrator", "mlt", "--mutations", 64, "--stats", "a.json"]
    flags += ["--mutation-weights", "lens=0.4,bidirectional=0.5"]
    flags += ["--mutation-weights", "new_path=0.1", "--direct", "mlt", "--two-stage"]
    done = usdmlt_command("render", stage, "a.exr", "-w", 32, *flags)
    assert done.returncode == 0, done.stderr
    chosen, written = done.stderr.splitlines()
    assert "mlt, 64 mutations per pixel, depth 16" in chosen
    assert re.match(r"wrote a.exr: \d+(\.\d)? mutations per pixel \(all units\)", written)
    stats = json.loads((tmp_path / "a.json").read_text())
    assert stats["integrator"] == stats["settings"]["integrator"] == "mlt"
    assert stats["samples_per_pixel"] >= 64
    assert 0 < stats["mutations"] < stats["samples_per_pixel"] * 32 * 16
    assert stats["settings"]["direct"] == "mlt"
    assert stats["settings"]["two_stage"] is True
    tried = {name for name, row in stats["mutation"].items() if row["proposed"] > 0}
    assert tried == {"lens", "bidirectional", "new_path"}
    metadata = read_image(tmp_path / "a.exr").metadata
    assert metadata["integrator"] == "mlt"
    assert metadata["mutations"] == pytest.approx(stats["samples_per_pixel"])
    assert "samples" not in metadata


def test_mutations_alone_ask_for_mlt(usdmlt_command: Run, stage: Path) -> None:
    done = usdmlt_command("render", stage, "a.png", "-w", 32, "--mutations", 16)
    assert done.returncode == 0, done.stderr
    assert "mlt (auto: mutations are asked for), 16 mutations per pixel" in done.stderr


def test_a_time_limit_ends_mlt(usdmlt_command: Run, stage: Path, tmp_path: Path) -> None:
    flags = ["--integrator", "mlt", "--time", 0.5, "--stats", "a.json"]
    done = usdmlt_command("render", stage, "a.exr", "-w", 64, *flags)
    assert done.returncode == 0, done.stderr
    stats = json.loads((tmp_path / "a.json").read_text())
    assert 0.4 < stats["seconds"] < 1.5
    assert 0 < stats["units_done"] < stats["units_total"]
    assert f"mutations per pixel (units 0:{stats['units_done']})" in done.stderr


def test_quiet_is_quiet(usdmlt_command: Run, stage: Path) -> None:
    done = usdmlt_command("render", stage, "a.exr", "-w", 32, "--samples", 3, "-q")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_png_is_written(usdmlt_command: Run, stage: Path, tmp_path: Path) -> None:
    assert usdmlt_command("render", stage, "a.png", "-w", 32, "--samples", 4).returncode == 0
    file = oiio.ImageInput.open(str(tmp_path / "a.png"))
    assert file.spec().channelnames == ("R", "G", "B")
    pixels = file.read_image("uint8")
    red, green, blue = pixels[8, 16]
    assert red > green > blue > 0


def test_frames_get_a_file_each(usdmlt_command: Run, stage: Path, tmp_path: Path) -> None:
    done = usdmlt_command(
        "render", stage, "a.##.exr", "-f", "1:3x2", "--stats", "a.##.json", "-w", 16, "--samples", 1
    )
    assert done.returncode == 0, done.stderr
    names = ["a.01.exr", "a.01.json", "a.03.exr", "a.03.json"]
    assert sorted(os.listdir(tmp_path)) == [*names, stage.name]


def test_stats_are_json(usdmlt_command: Run, stage: Path, tmp_path: Path) -> None:
    flags = ["-w", 32, "--samples", 4, "--depth", 3, "--stats", "a.json"]
    assert usdmlt_command("render", stage, "a.exr", *flags).returncode == 0
    stats = json.loads((tmp_path / "a.json").read_text())
    assert stats["samples"] == 32 * 16 * 4
    assert stats["samples_per_pixel"] == 4
    assert stats["units_done"] == stats["units_total"] > 0
    assert stats["rays"] >= stats["samples"]
    assert stats["seconds"] > 0
    assert len(stats["path_length_energy"]) == 4
    assert stats["settings"]["depth"] == 3
    assert stats["settings"]["integrator"] == "bdpt"


def test_res_sets_both_sides(usdmlt_command: Run, stage: Path, tmp_path: Path) -> None:
    assert usdmlt_command("render", stage, "a.exr", "--res", 24, 20).returncode == 0
    image = read_image(tmp_path / "a.exr")
    assert (image.width, image.height) == (24, 20)


def test_a_time_limit_ends_the_render(usdmlt_command: Run, stage: Path, tmp_path: Path) -> None:
    started = time.monotonic()
    done = usdmlt_command("render", stage, "a.exr", "-w", 64, "--time", 1, "--stats", "a.json")
    elapsed = time.monotonic() - started
    assert done.returncode == 0, done.stderr
    stats = json.loads((tmp_path / "a.json").read_text())
    # Started units finish; one lasts half a second at most.
    assert 0.9 < stats["seconds"] < 2
    assert elapsed < 20
    assert stats["samples_per_pixel"] > 64
    assert f"units 0:{stats['units_done']}" in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(
    ("number", "status", "integrator"),
    [(signal.SIGINT, 130, "path"), (signal.SIGTERM, 143, "path"), (signal.SIGINT, 130, "mlt")],
)
def test_a_signal_keeps_the_work_so_far(
    stage: Path, tmp_path: Path, number: signal.Signals, status: int, integrator: str
) -> None:
    command = [sys.executable, "-m", "usdmlt", "render", str(stage), "a.exr"]
    flags = ["-w", "64", "--integrator", integrator, "--samples", str(2**20), "--stats", "a.json"]
    process = subprocess.Popen(
        command + flags, cwd=tmp_path, stderr=subprocess.PIPE, text=True, bufsize=1
    )
    assert process.stderr is not None
    assert "s per pixel" in process.stderr.readline()  # said when rendering starts
    time.sleep(0.5)
    process.send_signal(number)
    said = process.communicate(timeout=20)[1]
    assert process.returncode == status, said
    stats = json.loads((tmp_path / "a.json").read_text())
    assert 0 < stats["units_done"] < stats["units_total"]
    assert f"units 0:{stats['units_done']}" in said
    assert read_image(tmp_path / "a.exr")["color"].max() > 0
    assert sorted(os.listdir(tmp_path)) == ["a.exr", "a.json", stage.name]


def test_an_interrupted_picture_is_the_one_that_its_units_give_again(
    usdmlt_command: Run, stage: Path, tmp_path: Path
) -> None:
    """Stopping does not favour cheap units: what is kept is a prefix of the full render."""
    import usdmlt

    usdmlt_command("render", stage, "a.exr", "-w", 128, "--time", 0.3, "--seed", 5)
    stopped = read_image(tmp_path / "a.exr")
    settings = usdmlt.Settings(samples=usdmlt.Settings(time=1).resolved_samples, seed=5)
    rendering = usdmlt.Rendering(usdmlt.load(stage, width=128), settings)
    rendering.run(until=int(stopped.metadata["units"]))
    again = rendering.image()["color"].astype(np.float16)
    np.testing.assert_array_equal(again, stopped["color"])
