"""Dome textures of every layout show the same surroundings."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest

from usdmlt.stage.dome_formats import LAYOUTS, layout, to_latlong

SIZES = {"angular": (256, 256), "mirroredBall": (512, 512), "cubeMapVerticalCross": (192, 256)}


def surroundings(d: np.ndarray) -> np.ndarray:
    """A smooth colour for every direction, without symmetries."""
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack([1 + 0.5 * x + 0.2 * y * z, 1 + 0.6 * y - 0.3 * x * z, 1 + 0.7 * z], -1)


def latlong_directions(height: int) -> np.ndarray:
    """From the definition: t = acos(y)/π from the top, s = 1/2 - atan2(x, z)/2π."""
    t = (np.arange(height) + 0.5)[:, None] / height * np.pi
    turn = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2 * np.pi
    d = [np.sin(t) * np.sin(turn), np.cos(t) + 0 * turn, np.sin(t) * np.cos(turn)]
    return np.stack(np.broadcast_arrays(*d), -1)


def image_directions(name: str, width: int, height: int) -> np.ndarray:
    """What each pixel shows, as the layout is defined: the viewer looks along +z, -x at the right.

    NaN where nothing is shown.
    """
    u = (np.arange(width) + 0.5) / width
    v = (np.arange(height) + 0.5) / height
    u, v = np.meshgrid(u, v)
    if name == "cubeMapVerticalCross":
        d = np.full((height, width, 3), np.nan)
        face = width // 3
        w = (np.arange(face) + 0.5) / face * 2 - 1
        right, down = np.meshgrid(w, w)
        one = np.ones_like(w)[None] * np.ones_like(w)[:, None]
        faces = {  # (column, row): right, up and ahead of each of its pixels
            (1, 1): (right, -down, one),
            (0, 1): (-one, -down, right),
            (2, 1): (one, -down, -right),
            (1, 0): (right, one, down),
            (1, 2): (right, -one, -down),
            (1, 3): (right, down, -one),
        }
        for (column, row), (r, up, ahead) in faces.items():
            rows, columns = (slice(i * face, (i + 1) * face) for i in (row, column))
            d[rows, columns] = np.stack([-r, up, ahead], -1)
        return d / np.linalg.norm(d, axis=-1, keepdims=True)
    x, y = 2 * u - 1, 1 - 2 * v
    radius = np.hypot(x, y)
    angle = np.pi * radius if name == "angular" else 2 * np.arcsin(np.minimum(radius, 1))
    d = np.stack([-np.sin(angle) * x / radius, np.sin(angle) * y / radius, np.cos(angle)], -1)
    return np.where(radius[..., None] <= 1, d, np.nan)


def pixels_of(name: str) -> np.ndarray:
    return np.nan_to_num(surroundings(image_directions(name, *SIZES[name]))).astype(np.float32)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_becomes_the_latlong_image_of_the_same_surroundings(name):
    result = to_latlong(pixels_of(name), name)
    directions = latlong_directions(len(result))
    difference = np.abs(result - surroundings(directions)).max(axis=-1)
    # Behind the viewer a ball's picture ends, and the last texel there mixes with the black around.
    ahead = directions[..., 2] > -0.97
    assert np.abs(difference[ahead]).max() < 0.03
    assert np.median(difference) < 2e-3


@pytest.mark.parametrize(
    ("name", "size", "expected"),
    [
        ("automatic", (300, 400), "cubeMapVerticalCross"),
        ("automatic", (400, 200), "latlong"),
        (None, (400, 200), "latlong"),
        ("angular", (400, 200), "angular"),
    ],
)
def test_automatic_goes_by_the_shape(name, size, expected):
    assert layout(name, *size) == expected


@pytest.mark.parametrize("name", ["angular", "mirroredBall", "cubeMapVerticalCross"])
def test_a_stage_names_the_layout(read, tmp_path, name):
    pixels = pixels_of(name)
    image = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float"))
    image.set_pixels(oiio.ROI.All, pixels)
    image.write(str(tmp_path / "sky.exr"))
    scene = read(f"""def DomeLight "d" {{ asset inputs:texture:file = @sky.exr@
        token inputs:texture:format = "{name}" }}""")
    texture = scene.textures[scene.lights[0].texture]
    height = texture.pixels.shape[0]
    assert texture.pixels.shape == (height, 2 * height, 3)
    middle = texture.pixels[height // 2, height]
    assert middle == pytest.approx(surroundings(np.array([0.0, 0.0, 1.0])), abs=0.03)


def test_an_unknown_layout_is_a_warning(examine, tmp_path):
    oiio.ImageBuf(oiio.ImageSpec(4, 2, 3, "float")).write(str(tmp_path / "sky.exr"))
    body = """def DomeLight "d" { asset inputs:texture:file = @sky.exr@
        token inputs:texture:format = "octahedral" }"""
    kinds = [w.kind for w in examine(body).warnings]
    assert "dome textures are read as latlong" in kinds
