"""EXR files: names, types, parts and attributes, as other readers find them."""

from __future__ import annotations

import json
import logging
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from usdmlt import Image, exr, image_files, layers, read_image

SIZE = (5, 7)
LAYERS = ("color", "alpha", "error", "albedo", "N", "P", "Z", "uv", "objectId", "CryptoObject")


def picture(**metadata: Any) -> Image:
    """With a layer of each kind; values that half floats have where a layer is stored so."""
    rng = np.random.default_rng(1)
    channels: dict[str, np.ndarray] = {}
    for name in LAYERS:
        layer = layers.KNOWN[name]
        shape = SIZE if len(layer.channels) == 1 else (*SIZE, len(layer.channels))
        values = rng.uniform(-1, 1, shape).astype(np.float32)
        if layer.half:
            values = values.astype(np.float16).astype(np.float32)
        channels[name] = values
    channels["objectId"] = rng.integers(0, 2**24, SIZE, dtype=np.uint32)
    return Image(channels, metadata={"renderer": "usdmlt 0", "stage": "a.usda", **metadata})


def spec_of(path: Path, number: int = 0) -> Any:
    return oiio.ImageInput.open(str(path)).spec(number)


@pytest.mark.parametrize("multipart", [False, True])
@pytest.mark.parametrize("pixel_type", ["half", "float"])
@pytest.mark.parametrize("compression", ["none", "rle", "zip", "zips", "piz"])
def test_every_layer_comes_back_as_it_was(
    tmp_path: Path, multipart: bool, pixel_type: str, compression: str
) -> None:
    image = picture()
    how = {"multipart": multipart, "pixel_type": pixel_type, "compression": compression}
    image.write(tmp_path / "a.exr", **how)
    again = read_image(tmp_path / "a.exr")
    assert list(again.channels)[:2] == ["color", "alpha"]
    assert set(again.channels) == set(LAYERS)
    for name, pixels in image.channels.items():
        assert again[name].dtype == pixels.dtype
        np.testing.assert_array_equal(again[name], pixels, err_msg=name)
    assert spec_of(tmp_path / "a.exr").getattribute("compression") == compression


def test_channels_are_named_and_typed_as_compositors_expect(tmp_path: Path) -> None:
    """R, G, B, A without a layer's name, as Nuke wants them; in one part."""
    picture().write(tmp_path / "a.exr")
    spec = spec_of(tmp_path / "a.exr")
    assert spec.channelnames[:4] == ("R", "G", "B", "A")
    types = {name: str(spec.channelformat(c)) for c, name in enumerate(spec.channelnames)}
    assert types == {
        **dict.fromkeys(("R", "G", "B", "A"), "half"),
        **dict.fromkeys(("albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z"), "half"),
        **dict.fromkeys(("error.Y", "Z", "P.X", "P.Y", "P.Z", "uv.U", "uv.V"), "float"),
        **{f"CryptoObject.{c}": "float" for c in "RGBA"},
        "objectId": "uint",
    }
    assert not spec_of(tmp_path / "a.exr", 1).nchannels


def test_parts_are_named_as_layers_and_share_what_they_have_to(tmp_path: Path) -> None:
    window = {"x": 2, "y": 1, "width": 7, "height": 5, "full_width": 20, "full_height": 10}
    picture(data_window=window, pixel_aspect_ratio=2.0).write(tmp_path / "a.exr", multipart=True)
    specs = [spec for spec, _ in image_files.read_parts(tmp_path / "a.exr")]
    names = [spec.getattribute("oiio:subimagename") for spec in specs]
    assert names == ["picture", *(name for name in LAYERS if name not in ("color", "alpha"))]
    for spec in specs:
        assert (spec.x, spec.y, spec.full_width, spec.full_height) == (2, 1, 20, 10)
        assert spec.getattribute("PixelAspectRatio") == 2
        assert len(spec.getattribute("chromaticities")) == 8
    spaces = {n: s.getattribute("colorInteropID") for n, s in zip(names, specs, strict=True)}
    assert spaces["picture"] == spaces["albedo"] == "lin_rec709_scene"
    assert spaces["N"] == spaces["objectId"] == "data"
    assert specs[0].getattribute("usdmlt:stage") == "a.usda"
    assert read_image(tmp_path / "a.exr").metadata["data_window"] == window


def test_the_openexr_package_reads_the_same(tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    image = picture(
        worldToNDC=np.arange(16.0).reshape(4, 4), pixel_aspect_ratio=1.5, frames_per_second=23.976
    )
    image.write(tmp_path / "a.exr")
    with openexr.File(str(tmp_path / "a.exr")) as file:
        header, channels = file.header(), file.channels()
        assert header["compression"] == openexr.ZIP_COMPRESSION
        assert header["pixelAspectRatio"] == 1.5
        assert str(header["framesPerSecond"]) == "24000/1001"
        np.testing.assert_array_equal(np.ravel(header["worldToNDC"]), np.arange(16))
        np.testing.assert_array_equal(channels["RGBA"].pixels[..., :3], image["color"])
        np.testing.assert_array_equal(channels["Z"].pixels, image["Z"])
        np.testing.assert_array_equal(channels["objectId"].pixels, image["objectId"])


def test_oiiotool_reads_it(tmp_path: Path) -> None:
    tool = Path(sysconfig.get_path("scripts")) / "oiiotool"
    if not tool.exists():
        pytest.skip("OpenImageIO came without oiiotool")
    picture(frames_per_second=24.0).write(tmp_path / "a.exr")
    command = [tool, "--info", "-v", "a.exr"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    for expected in (
        "7 x    5, 22 channel",
        "R (half), G (half), B (half), A (half), Z (float)",
        "objectId (uint)",
        "chromaticities: 0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329",
        'colorInteropID: "lin_rec709_scene"',
        "framesPerSecond: 24/1 (24)",
    ):
        assert expected in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("compression", ["dwaa", "dwab:30", "b44", "pxr24"])
def test_losses_are_small_and_of_colours_only(tmp_path: Path, compression: str) -> None:
    """Numbers and shares of Cryptomatte are lost by one wrong bit: they are parts of their own."""
    image = picture()
    smooth = np.linspace(0.1, 1, 32 * 32, dtype=np.float32).reshape(32, 32)
    image.channels = {
        name: np.stack([smooth] * pixels.shape[2], -1) if pixels.ndim == 3 else smooth
        for name, pixels in image.channels.items()
    }
    image.channels["objectId"] = np.arange(32 * 32, dtype=np.uint32).reshape(32, 32)
    with pytest.raises(ValueError, match=r"would break CryptoObject: choose zip, zips or piz, or"):
        image.write(tmp_path / "a.exr", compression=compression)
    assert not (tmp_path / "a.exr").exists()
    image.write(tmp_path / "a.exr", compression=compression, multipart=True)
    again = read_image(tmp_path / "a.exr")
    np.testing.assert_allclose(again["color"], image["color"], atol=0.02)
    for name in ("CryptoObject", "objectId", "P", "Z", "error"):
        np.testing.assert_array_equal(again[name], image[name])


def test_float_pixels_keep_what_half_floats_cannot(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    image = picture()
    image["color"][0, 0] = 1e6, 1e-9, 1 / 3
    image.write(tmp_path / "a.exr", pixel_type="float")
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr")["color"], image["color"])
    assert not caplog.records


def test_numbers_too_large_for_one_part_get_their_own_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    image = picture()
    image["objectId"][1, 2] = 2**32 - 7
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        image.write(tmp_path / "a.exr", multipart=True)
        assert not caplog.records
        image.write(tmp_path / "b.exr")
    assert "objectId is an EXR part of its own" in caplog.text
    for name in ("a.exr", "b.exr"):
        np.testing.assert_array_equal(read_image(tmp_path / name)["objectId"], image["objectId"])
    assert spec_of(tmp_path / "b.exr", 1).channelnames == ("objectId",)
    assert not spec_of(tmp_path / "b.exr", 2).nchannels


def test_the_date_is_now_and_readers_know_it(tmp_path: Path) -> None:
    picture(date="2026:01:31 23:59:58").write(tmp_path / "a.exr")
    assert spec_of(tmp_path / "a.exr").getattribute("DateTime") == "2026:01:31 23:59:58"


@pytest.mark.parametrize(
    "how", [{"compression": "gzip"}, {"compression": "dwaa:high"}, {"pixel_type": "double"}]
)
def test_formats_that_are_none_are_refused(tmp_path: Path, how: dict[str, str]) -> None:
    with pytest.raises(ValueError, match=r"compression|pixel_type"):
        picture().write(tmp_path / "a.exr", **how)
    assert not list(tmp_path.iterdir())


KILLED = """
import sys
import numpy as np
from usdmlt import Image
rng = np.random.default_rng(int(sys.argv[2]))
rgba = rng.random((300, 300, 4), dtype=np.float32)
image = Image.from_rgba(rgba, metadata={"seed": int(sys.argv[2])})
image.write(sys.argv[1])
print("ready", flush=True)
while True:
    image.write(sys.argv[1])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does")
def test_a_kill_at_any_moment_leaves_a_whole_picture(tmp_path: Path) -> None:
    """A process that writes one picture again and again is killed at twelve moments of a write,
    which lasts some 30 ms; what is there is whole, and is that of a process that had written."""
    path = tmp_path / "a.exr"
    rng = np.random.default_rng(3)
    half_written = 0
    for seed in range(12):
        command = [sys.executable, "-c", KILLED, str(path), str(seed)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None and process.stdout.readline() == "ready\n"
            with np.errstate(all="ignore"):
                try:
                    process.wait(rng.uniform(0, 0.06))
                except subprocess.TimeoutExpired:
                    process.kill()
        again = read_image(path)
        expected = np.random.default_rng(seed).random((300, 300, 4), dtype=np.float32)
        np.testing.assert_array_equal(again["color"], expected[..., :3].astype(np.float16))
        assert again.metadata["seed"] == seed
        for other in tmp_path.glob(".a.*"):
            half_written += 1
            other.unlink()
    assert half_written >= 3, "no kill came while the file was being written"


def test_references_keep_their_statistics_out_of_the_layers(tmp_path: Path) -> None:
    image = picture()
    parts = exr.parts(image)
    parts[0].attributes["oiio:subimagename"] = exr.FIRST_PART
    attributes = {"oiio:subimagename": exr.STATISTICS_PART}
    attributes["chromaticities"] = parts[0].attributes["chromaticities"]
    statistics = image_files.Part({"00.R": image["Z"]}, attributes)
    image_files.write_parts(tmp_path / "a.exr", [*parts, statistics])
    assert set(read_image(tmp_path / "a.exr").channels) == set(LAYERS)


def test_json_survives_as_an_attribute(tmp_path: Path) -> None:
    text = json.dumps({"a": ["ä", '"', "\\", 1.5] * 500})
    picture(settings=text).write(tmp_path / "a.exr")
    assert read_image(tmp_path / "a.exr").metadata["settings"] == text
