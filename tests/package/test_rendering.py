"""`usdmlt.render` and `usdmlt.Rendering`."""

from __future__ import annotations

import logging
import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

import usdmlt
from usdmlt.rendering import truncated_fraction


def test_a_picture_is_arrays_statistics_and_metadata(stage: Path) -> None:
    image = usdmlt.render(stage, width=32, samples=4)
    assert image["color"].shape == (16, 32, 3)
    assert image["color"].dtype == np.float32
    assert image["alpha"].shape == (16, 32)
    assert image.color_space == "lin_rec709_scene"
    assert image.stats["samples"] == 16 * 32 * 4
    assert image.metadata["camera"] == "/World/main_cam"


def test_file_open_stage_and_scene_give_the_same_bits(stage: Path) -> None:
    from_file = usdmlt.render(stage, width=32, samples=4)["color"]
    from_stage = usdmlt.render(Usd.Stage.Open(str(stage)), width=32, samples=4)["color"]
    from_scene = usdmlt.render(usdmlt.load(stage, width=32), samples=4)["color"]
    np.testing.assert_array_equal(from_stage, from_file)
    np.testing.assert_array_equal(from_scene, from_file)


def test_seeds_differ_and_repeat(stage: Path) -> None:
    scene = usdmlt.load(stage, width=32)
    first, again, other = (usdmlt.render(scene, samples=1, seed=s)["color"] for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_render_in_pieces_is_the_render_in_one_go(stage: Path) -> None:
    scene = usdmlt.load(stage, width=80)
    pieces = usdmlt.Rendering(scene, usdmlt.Settings(samples=6))
    assert not pieces.run(until=1)
    assert pieces.units_done == 1
    assert pieces.run()
    np.testing.assert_array_equal(pieces.image()["color"], usdmlt.render(scene, samples=6)["color"])


def test_progress_is_told_and_ends_with_all_units(stage: Path) -> None:
    told: list[usdmlt.Progress] = []
    usdmlt.render(stage, width=64, samples=16, progress=told.append)
    assert told[-1].units_done == told[-1].units_total
    assert told[-1].samples_done == pytest.approx(64 * 32 * 16)
    assert [p.units_done for p in told] == sorted(p.units_done for p in told)


def test_an_error_in_the_progress_function_is_raised(stage: Path) -> None:
    def fail(progress: usdmlt.Progress) -> None:
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        usdmlt.render(stage, width=64, samples=16, progress=fail)


def test_a_scene_with_a_camera_argument_is_a_value_error(stage: Path) -> None:
    with pytest.raises(ValueError, match="own camera, frame and size"):
        usdmlt.render(usdmlt.load(stage, width=32), width=64)


def test_an_image_of_no_pixels_is_a_value_error(stage: Path) -> None:
    with pytest.raises(ValueError, match="width must be between"):
        usdmlt.render(stage, width=0)


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_raises_with_the_picture_so_far(stage: Path) -> None:
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    handler = signal.getsignal(signal.SIGINT)
    timer.start()
    with pytest.raises(KeyboardInterrupt) as caught:
        usdmlt.render(stage, width=64, time=30)
    assert isinstance(caught.value, usdmlt.Interrupted)
    stats = caught.value.image.stats
    assert 0 < stats["units_done"] < stats["units_total"]
    assert caught.value.image["color"].max() > 0
    assert signal.getsignal(signal.SIGINT) is handler


def test_rendering_in_another_thread_works(stage: Path) -> None:
    images: list[usdmlt.Image] = []
    thread = threading.Thread(
        target=lambda: images.append(usdmlt.render(stage, width=32, samples=2))
    )
    thread.start()
    thread.join(timeout=60)
    assert images[0].stats["samples_per_pixel"] == 2


def test_the_truncated_fraction_of_a_geometric_series_is_exact() -> None:
    energies = [0.0, *(0.5**k for k in range(1, 9))]
    assert truncated_fraction(energies) == pytest.approx(0.5**8, rel=1e-6)
    assert truncated_fraction([0.0, 1.0, 1.0]) == 0  # too few lengths to tell
    assert truncated_fraction([0.0] * 17) == 0


def test_a_depth_that_cuts_off_light_is_warned_about(caplog: pytest.LogCaptureFixture) -> None:
    """A closed furnace of albedo 0.9: half of the light takes paths of more than seven edges."""
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        usdmlt.render(furnace(albedo=0.9), samples=16, depth=7)
    assert "raise the depth" in caplog.text
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        usdmlt.render(furnace(albedo=0.5), samples=16, depth=16)
    assert "raise the depth" not in caplog.text


def furnace(albedo: float) -> usdmlt.Scene:
    """The inside of a cube whose walls all emit and reflect."""
    from usdmlt import scene

    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)], np.int32)
    wall = scene.Add(
        scene.UniformEmission((1.0, 1.0, 1.0)), scene.Diffuse((albedo, albedo, albedo))
    )
    return scene.Scene(
        width=16,
        height=16,
        meshes=[scene.Mesh(corners, triangles)],
        materials=[scene.Material(wall)],
    )
