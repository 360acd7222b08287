"""The part of a picture that is rendered."""

from __future__ import annotations

from itertools import pairwise

import pytest

from usdmlt.stage.data_window import DataWindow, data_window

SETTINGS = """
def RenderSettings "s" {
    uniform int2 resolution = (100, 50)
    uniform float4 dataWindowNDC = (WINDOW)
}
def Camera "c" {
    float horizontalAperture = 20
    float verticalAperture = 10
    float focalLength = 10
}
"""


@pytest.mark.parametrize(
    ("ndc", "expected"),
    [
        ((0, 0, 1, 1), (0, 0, 10, 4)),
        ((0.5, 0, 1, 1), (5, 0, 5, 4)),
        ((0, 0, 1, 0.5), (0, 2, 10, 2)),  # the lower half: y counts from the bottom
        # Pixel centres are at 0.05, 0.15, …: the third is the first beyond 0.24, 0.75 is the last.
        ((0.24, 0, 0.76, 1), (2, 0, 6, 4)),
        ((0.26, 0, 0.74, 1), (3, 0, 4, 4)),
        ((-0.2, -0.25, 1.1, 1.5), (-2, -2, 13, 7)),  # overscan
        ((0.3, 0, 0.7, 1), (3, 0, 4, 4)),  # edges between pixels, though no float is 0.7
    ],
)
def test_pixels_whose_centres_are_inside_are_rendered(ndc, expected):
    window = data_window(ndc, 10, 4)
    assert window == DataWindow(*expected, 10, 4)


def test_adjacent_windows_share_no_pixel_and_lose_none():
    edges = [0.0, 0.113, 0.25, 0.5, 0.77, 1.0]
    widths = [data_window((a, 0, b, 1), 37, 5) for a, b in pairwise(edges)]
    assert [w.x for w in widths[1:]] == [w.x + w.width for w in widths[:-1]]
    assert sum(w.width for w in widths) == 37


def test_a_window_between_pixel_centres_is_refused():
    with pytest.raises(ValueError, match="no pixel of 10 x 4 is in the window"):
        data_window((0.06, 0, 0.14, 1), 10, 4)


def test_the_camera_sees_the_window_alone(read):
    """The whole picture is 2 wide and 1 high at distance 1; the window its upper right quarter."""
    scene = read(SETTINGS.replace("WINDOW", "0.5, 0.5, 1, 1"))
    assert (scene.width, scene.height) == (50, 25)
    assert scene.camera.window == pytest.approx((0, 1, 0, 0.5))
    assert scene.metadata["data_window"] == DataWindow(50, 0, 50, 25, 100, 50)


def test_a_crop_asked_for_comes_before_the_settings(read):
    scene = read(SETTINGS.replace("WINDOW", "0.5, 0.5, 1, 1"), crop=(0, 0, 0.1, 1))
    assert (scene.width, scene.height) == (10, 50)
    assert scene.camera.window == pytest.approx((-1, -0.8, -0.5, 0.5))


@pytest.mark.parametrize("crop", [(0, 0, 0, 1), (0.5, 0, 0.4, 1), (0, 0, float("nan"), 1)])
def test_empty_crops_are_a_wrong_value(read, crop):
    with pytest.raises(ValueError, match="crop must"):
        read('def Cube "c" {}', crop=crop)
