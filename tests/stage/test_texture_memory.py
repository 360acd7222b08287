"""The limit on what textures take."""

from __future__ import annotations

import numpy as np
import pytest

from usdmlt.errors import Report
from usdmlt.scene import Texture
from usdmlt.stage.texture_memory import MEBIBYTE, halved, limit_textures


def texture(size: int, name: str) -> Texture:
    return Texture(np.ones((size, size, 3), np.float32), name=name)


def test_the_largest_are_halved_until_all_fit():
    large, small = texture(512, "large"), texture(64, "small")  # 3 MiB and 48 KiB
    report = Report()
    limit_textures([large, small], 0.5, report)
    assert large.pixels.shape == (128, 128, 3)
    assert small.pixels.shape == (64, 64, 3)
    assert (large.pixels.nbytes + small.pixels.nbytes) <= 0.5 * MEBIBYTE
    assert [str(w) for w in report.warnings] == [
        "textures are smaller than authored, to fit the memory limit: large"
    ]


def test_shared_pixels_count_once_and_stay_shared():
    a = texture(256, "a")  # 768 KiB
    b = Texture(a.pixels, wrap_s="clamp", name="a")
    limit_textures([a, b], 0.8, Report())
    assert a.pixels.shape == (256, 256, 3)
    limit_textures([a, b], 0.5, Report())
    assert a.pixels is b.pixels
    assert a.pixels.shape == (128, 128, 3)


def test_without_a_limit_nothing_changes():
    pixels = texture(256, "a").pixels
    textures = [Texture(pixels)]
    limit_textures(textures, None, Report())
    assert textures[0].pixels is pixels


@pytest.mark.parametrize("dtype", [np.float32, np.float16, np.uint8])
@pytest.mark.parametrize("shape", [(6, 8, 3), (5, 7, 1), (1, 9, 4), (3, 1, 2)])
def test_halving_keeps_the_mean_and_the_type(dtype, shape):
    random = np.random.default_rng(1)
    pixels = (random.integers(0, 200, shape)).astype(dtype)
    smaller = halved(pixels)
    assert smaller.dtype == dtype
    assert smaller.shape == (max(shape[0] // 2, 1), max(shape[1] // 2, 1), shape[2])
    if shape[0] % 2 == shape[1] % 2 == 0:
        assert smaller.mean() == pytest.approx(pixels.mean(), abs=0.5)
    assert smaller.min() >= pixels.min() and smaller.max() <= pixels.max()


def test_a_gradient_stays_where_it_was():
    """Means of two columns: 0.5, 2.5, … of 0, 1, 2, …"""
    columns = np.broadcast_to(np.arange(8, dtype=np.float32)[None, :, None], (2, 8, 1))
    np.testing.assert_array_equal(halved(columns)[0, :, 0], [0.5, 2.5, 4.5, 6.5])


def test_encoded_colours_are_averaged_as_light(tmp_path):
    """Black and white in sRGB: half the light is 188 of 255, not 128. Alpha is linear."""
    from usdmlt.stage.textures import curve

    decode = curve("srgb_rec709_scene", np.dtype(np.uint8))
    pixels = np.array([[[0, 0, 0, 0], [255, 255, 255, 255]]], np.uint8)
    assert halved(pixels, decode).tolist() == [[[188, 188, 188, 128]]]
    every = np.arange(256, dtype=np.uint8)[:, None, None].repeat(2, axis=1).repeat(3, axis=2)
    np.testing.assert_array_equal(halved(every[:1], decode), every[:1, :1])


def test_the_limit_is_an_option_of_reading(read, tmp_path):
    import OpenImageIO as oiio

    image = oiio.ImageBuf(oiio.ImageSpec(256, 128, 3, "float"))
    image.write(str(tmp_path / "sky.exr"))
    body = 'def DomeLight "d" { asset inputs:texture:file = @sky.exr@ }'
    assert read(body).textures[0].pixels.shape == (128, 256, 3)
    assert read(body, texture_memory=0.1).textures[0].pixels.shape == (64, 128, 3)
    with pytest.raises(ValueError, match="texture_memory must be positive"):
        read(body, texture_memory=0)
