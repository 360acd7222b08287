"""Texture lookups: filter, wraps, orientation, channels, precision."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from usdmlt.native import core
from usdmlt.scene import Texture

IMAGE = np.random.default_rng(3).uniform(0.1, 0.9, (5, 4, 3))  # 4 wide, 5 high


def lookup(pixels, st, wrap_s="repeat", wrap_t="repeat") -> np.ndarray:
    """Bilinear lookups, (n, 4)."""
    texture = Texture(np.asarray(pixels), wrap_s, wrap_t)
    return core().lookup_texture(texture, np.asarray(st, np.float32).reshape(-1, 2))


def centre(column: int, row: int) -> tuple[float, float]:
    """Texture coordinates of a texel of IMAGE; row 0 is on top, where t is 1."""
    height, width = IMAGE.shape[:2]
    return (column + 0.5) / width, 1 - (row + 0.5) / height


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_at_texel_centres_the_lookup_is_the_texel(dtype):
    """Catches an image that is flipped, transposed or shifted by half a texel."""
    image = IMAGE.astype(dtype)
    for row in range(5):
        for column in range(4):
            found = lookup(image, centre(column, row))[0]
            assert_allclose(found[:3], image[row, column].astype(np.float32), rtol=1e-5)
            assert found[3] == pytest.approx(1)


def test_the_lower_left_corner_of_the_image_is_the_origin():
    image = np.zeros((2, 2, 1), np.float32)
    image[1, 0] = 1  # bottom row, left column
    assert lookup(image, (0.25, 0.25))[0, 0] == 1
    assert lookup(image, [(0.75, 0.25), (0.25, 0.75)])[:, 0] == pytest.approx(0)


def test_between_texel_centres_the_lookup_is_bilinear():
    (s0, t0), (s1, t1) = centre(1, 3), centre(2, 2)
    x, y = 0.3, 0.8
    found = lookup(IMAGE, (s0 + x * (s1 - s0), t0 + y * (t1 - t0)))[0, :3]
    lower = (1 - x) * IMAGE[3, 1] + x * IMAGE[3, 2]
    upper = (1 - x) * IMAGE[2, 1] + x * IMAGE[2, 2]
    assert_allclose(found, (1 - y) * lower + y * upper, rtol=1e-5)


WRAPPED = {  # columns −6 … 9 of an image 4 wide
    "repeat": [2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1],
    "mirror": [2, 3, 3, 2, 1, 0, 0, 1, 2, 3, 3, 2, 1, 0, 0, 1],
    "clamp": [0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 3, 3, 3, 3, 3, 3],
}


@pytest.mark.parametrize("wrap", WRAPPED)
def test_wraps_continue_the_image(wrap):
    columns = np.arange(-6, 10)
    st = [((c + 0.5) / 4, centre(0, 2)[1]) for c in columns]
    expected = IMAGE[2, WRAPPED[wrap]]
    assert_allclose(lookup(IMAGE, st, wrap_s=wrap)[:, :3], expected, rtol=1e-5)
    # The other axis likewise, on the transposed image; its rows run against t.
    transposed = IMAGE.transpose(1, 0, 2)[::-1]
    ts = [((2 + 0.5) / 5, (c + 0.5) / 4) for c in columns]
    assert_allclose(lookup(transposed, ts, wrap_t=wrap)[:, :3], expected, rtol=1e-5)


def test_black_is_transparent_black_outside_and_fades_over_half_a_texel():
    st = [(-0.2, 0.5), (1.3, 0.5), (0.5, -0.2), (0.5, 1.3), (50.0, 0.5)]
    assert_array_equal(lookup(IMAGE, st, "black", "black"), 0)
    edge = lookup(IMAGE, (0.0, centre(0, 2)[1]), "black", "black")[0]
    assert_allclose(edge, [*(IMAGE[2, 0] / 2), 0.5], rtol=1e-5)
    # The wraps of the axes are independent.
    assert (lookup(IMAGE, (1.3, 0.5), "repeat", "black")[0, :3] > 0).all()


def test_seams_of_repeated_images_are_filtered_across():
    found = lookup(IMAGE, (0.0, centre(0, 1)[1]))[0, :3]
    assert_allclose(found, (IMAGE[1, 0] + IMAGE[1, 3]) / 2, rtol=1e-5)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_channels_that_are_not_there_follow_the_rules(channels):
    """One is grey, two are grey and alpha, three have alpha 1."""
    pixel = np.array([0.25, 0.5, 0.75, 0.125])[:channels]
    image = np.tile(pixel, (3, 3, 1)).astype(np.float32)
    expected = {
        1: [0.25, 0.25, 0.25, 1],
        2: [0.25, 0.25, 0.25, 0.5],
        3: [0.25, 0.5, 0.75, 1],
        4: [0.25, 0.5, 0.75, 0.125],
    }
    assert_allclose(lookup(image, (0.4, 0.6))[0], expected[channels])


def test_every_half_is_read_exactly():
    """All finite values: normal, subnormal, zeros of both signs, the largest."""
    bits = np.arange(65536, dtype=np.uint32).astype(np.uint16)
    halves = bits.view(np.float16)
    halves = halves[np.isfinite(halves)]
    image = np.resize(halves, (256, 256, 1))
    row, column = np.divmod(np.arange(image.size), 256)
    st = np.stack([(column + 0.5) / 256, 1 - (row + 0.5) / 256], axis=1)
    assert_array_equal(lookup(image, st)[:, 0], image.ravel().astype(np.float32))


def test_neighbours_of_weight_zero_do_not_matter():
    image = np.full((2, 2, 1), np.inf, np.float32)
    image[0, 0] = 1
    assert lookup(image, (0.25, 0.75), "clamp", "clamp")[0, 0] == 1


@pytest.mark.parametrize("wrap", ["black", "clamp", "repeat", "mirror"])
def test_coordinates_that_are_no_numbers_or_huge_are_survived(wrap):
    st = [(np.nan, 0.5), (np.inf, 0.5), (-np.inf, -np.inf), (1e30, 0.5), (-3e9, 3e9)]
    assert np.isfinite(lookup(IMAGE, st, wrap, wrap)).all()


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 0), (4, 4, 5), (0, 4, 3)])
def test_arrays_that_are_no_images_are_refused(shape):
    with pytest.raises(ValueError, match="texture 'broken' is not"):
        core().lookup_texture(Texture(np.zeros(shape), name="broken"), np.zeros((1, 2)))
