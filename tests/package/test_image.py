"""Image files: what is in them, and that they are whole or absent."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from usdmlt import Error, Image, read_image


def picture(height: int = 5, width: int = 7) -> Image:
    rng = np.random.default_rng(1)
    rgba = rng.random((height, width, 4), dtype=np.float32)
    return Image.from_rgba(
        rgba,
        metadata={
            "renderer": "usdmlt 0",
            "stage": "a.usda",
            "camera": "/World/main_cam",
            "frame": 1.5,
            "seed": 7,
            "samples": 64.0,
            "worldToCamera": np.arange(16.0).reshape(4, 4),
            "absent": None,
        },
    )


def test_exr_has_half_rgba_in_that_order_and_the_values_given(tmp_path: Path) -> None:
    image = picture()
    image.write(tmp_path / "a.exr")
    file = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    spec, pixels = file.spec(), file.read_image("float")
    assert spec.channelnames == ("R", "G", "B", "A")
    assert [str(spec.channelformat(c)) for c in range(4)] == ["half"] * 4
    np.testing.assert_array_equal(pixels[..., :3], image["color"].astype(np.float16))
    np.testing.assert_array_equal(pixels[..., 3], image["alpha"].astype(np.float16))


def test_exr_states_its_colour_space_and_its_making(tmp_path: Path) -> None:
    picture().write(tmp_path / "a.exr")
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    rec709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    np.testing.assert_allclose(spec.getattribute("chromaticities"), rec709, rtol=1e-6)
    assert spec.getattribute("colorInteropID") == "lin_rec709_scene"
    assert spec.getattribute("renderer") == "usdmlt 0"
    assert spec.getattribute("usdmlt:stage") == "a.usda"
    assert spec.getattribute("usdmlt:camera") == "/World/main_cam"
    assert spec.getattribute("usdmlt:frame") == 1.5
    assert spec.getattribute("usdmlt:seed") == 7
    assert spec.getattribute("usdmlt:samples") == 64
    assert spec.getattribute("worldToCamera") == tuple(range(16))
    assert spec.getattribute("usdmlt:absent") is None


def test_acescg_pictures_carry_the_acescg_primaries(tmp_path: Path) -> None:
    image = picture()
    image.color_space = "lin_ap1_scene"
    image.write(tmp_path / "a.exr")
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    assert spec.getattribute("colorInteropID") == "lin_ap1_scene"
    np.testing.assert_allclose(spec.getattribute("chromaticities")[:2], (0.713, 0.293), rtol=1e-6)


def test_what_was_written_can_be_read(tmp_path: Path) -> None:
    image = picture()
    image.write(tmp_path / "a.exr")
    again = read_image(tmp_path / "a.exr")
    np.testing.assert_array_equal(again["color"], image["color"].astype(np.float16))
    assert again.color_space == image.color_space
    assert again.metadata["camera"] == "/World/main_cam"
    assert (again.height, again.width) == (5, 7)


def test_the_error_is_a_channel_of_floats_that_comes_back_as_it_was(tmp_path: Path) -> None:
    """Errors far below the smallest half, 6e-8, and above the largest are kept."""
    image = picture()
    rng = np.random.default_rng(2)
    image.channels["error"] = np.float32(10) ** rng.uniform(-20, 6, (5, 7)).astype(np.float32)
    image.write(tmp_path / "a.exr")
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    assert spec.channelnames == ("R", "G", "B", "A", "error.Y")
    assert [str(spec.channelformat(c)) for c in range(5)] == ["half"] * 4 + ["float"]
    again = read_image(tmp_path / "a.exr")
    np.testing.assert_array_equal(again["error"], image["error"])
    np.testing.assert_array_equal(again["color"], image["color"].astype(np.float16))
    image.write(tmp_path / "a.png")
    assert oiio.ImageInput.open(str(tmp_path / "a.png")).spec().channelnames == ("R", "G", "B")


def test_a_picture_says_in_a_line_what_it_has() -> None:
    assert repr(picture()) == "<7x5 lin_rec709_scene: color, alpha>"


def test_a_picture_without_error_has_none_when_read(tmp_path: Path) -> None:
    picture().write(tmp_path / "a.exr")
    assert "error" not in read_image(tmp_path / "a.exr").channels


def test_reading_a_missing_file_is_an_error_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(Error, match=r"cannot read .*none\.exr") as caught:
        read_image(tmp_path / "none.exr")
    assert "\n" not in str(caught.value)


def test_png_is_the_opaque_srgb_view(tmp_path: Path) -> None:
    linear = np.array([-1.0, 0.0, 0.002, 0.215861, 1.0, 5.0], np.float32)
    rgba = np.repeat(linear[None, :, None], 4, axis=2) * np.float32([1, 1, 1, 0])
    Image.from_rgba(rgba).write(tmp_path / "a.png")
    file = oiio.ImageInput.open(str(tmp_path / "a.png"))
    assert file.spec().channelnames == ("R", "G", "B")
    # 0.215861 is what the sRGB curve shows as 128 of 255; below 0.0031308 it is 12.92 x.
    expected = [0, 0, round(255 * 12.92 * 0.002), 128, 255, 255]
    assert file.read_image("uint8")[0, :, 1].tolist() == expected


def test_png_of_an_acescg_picture_shows_white_as_white_and_red_clipped(tmp_path: Path) -> None:
    rgba = np.float32([[[1, 1, 1, 1], [1, 0, 0, 1]]])
    Image.from_rgba(rgba, color_space="lin_ap1_scene").write(tmp_path / "a.png")
    white, red = oiio.ImageInput.open(str(tmp_path / "a.png")).read_image("uint8")[0].tolist()
    assert white == [255, 255, 255]
    assert red == [255, 0, 0]


def test_values_beyond_half_are_clamped_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rgba = np.zeros((2, 2, 4), np.float32)
    rgba[0, 0] = 1e6, 65504, 65519, -1e6
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        Image.from_rgba(rgba).write(tmp_path / "a.exr")
    again = read_image(tmp_path / "a.exr")
    assert again["color"][0, 0].tolist() == [65504, 65504, 65504]
    assert again["alpha"][0, 0] == -65504
    assert [r.getMessage() for r in caplog.records] == [
        "3 values beyond the range of half floats were clamped to 65504"
    ]


def test_other_extensions_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.exr, \.png, \.jpg or"):
        picture().write(tmp_path / "a.tif")


def test_a_directory_that_does_not_exist_is_an_error_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(Error, match="cannot write") as caught:
        picture().write(tmp_path / "none" / "a.exr")
    assert "\n" not in str(caught.value)


def test_a_symbolic_link_stays_and_its_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "real.exr").write_bytes(b"old")
    (tmp_path / "link.exr").symlink_to("real.exr")
    picture().write(tmp_path / "link.exr")
    assert (tmp_path / "link.exr").is_symlink()
    assert read_image(tmp_path / "real.exr").width == 7


@pytest.mark.skipif(sys.platform == "win32", reason="limits the file size as POSIX does")
@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.jpg"])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path: Path, name: str) -> None:
    """At every size at which the disk can be full, the last bytes included.

    OpenImageIO does not report what fails when the file is closed.
    """
    script = tmp_path / "fill.py"
    script.write_text(
        """
import os, resource, sys
import numpy as np
from pathlib import Path
from usdmlt import Error, Image
rgba = np.random.default_rng(1).random((64, 64, 4), dtype=np.float32)
image = Image.from_rgba(rgba)
image.channels["error"] = rgba[..., 0] ** 9
path = Path(sys.argv[1])
image.write(path)
whole = path.read_bytes()
for limit in [*range(0, len(whole), 997), *range(len(whole) - 13, len(whole))]:
    path.write_bytes(b"old")
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        image.write(path)
        sys.exit(f"with room for {limit} of {len(whole)} bytes no error was raised")
    except Error as error:
        assert "cannot write" in str(error) and "\\n" not in str(error), error
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
    assert path.read_bytes() == b"old"
    assert os.listdir(path.parent) == [path.name]
print("tried", limit)
"""
    )
    target = tmp_path / "out" / name
    target.parent.mkdir()
    done = subprocess.run([sys.executable, script, target], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "tried" in done.stdout


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_directory_without_permission_is_an_error(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(Error, match="Permission denied"):
        picture().write(tmp_path / "a.exr")
