"""A colour checker keeps its XYZ from the stage to the EXR, whatever space it was rendered in.

One bounce of neutral light: radiance is albedo times a number. (After more bounces, products of
components differ between spaces by nature.)
"""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import usdmlt

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour

# What a stage calls it, colour-science's name, and whether values are encoded.
AUTHORED = {
    "srgb_rec709_scene": ("sRGB", True),
    "srgb_p3d65_scene": ("Display P3", True),
    "lin_ap1_scene": ("ACEScg", False),
}
RENDERED = ("lin_rec709_scene", "lin_ap1_scene", "lin_rec2020_scene")
D65 = np.array([0.3127, 0.3290])
COLUMNS, ROWS, PIXELS = 6, 4, 4
CYAN = 17

STAGE = """#usda 1.0
def Camera "main_cam" {{
    token projection = "orthographic"
    float horizontalAperture = 60
    float verticalAperture = 40
    double3 xformOp:translate = (3, 2, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def DistantLight "sun" {{
    float inputs:angle = 0
    float inputs:intensity = 3.14159265
}}
def Mesh "chart" {{
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {indices}
    point3f[] points = {points}
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = {colors} (
        interpolation = "uniform"
        colorSpace = "{space}"
    )
}}
"""


def bradford(white: np.ndarray) -> np.ndarray:
    whites = (colour.xy_to_XYZ(xy) for xy in (white, D65))
    return colour.adaptation.matrix_chromatic_adaptation_VonKries(*whites, "Bradford")


@cache
def chart(space: str) -> tuple[np.ndarray, np.ndarray]:
    """The 24 patches as authored, and the XYZ that they mean, adapted to D65."""
    name, encoded = AUTHORED[space]
    rgb_space = colour.RGB_COLOURSPACES[name]
    checker = colour.CCS_COLOURCHECKERS["ColorChecker24 - After November 2014"]
    xyz = np.array([colour.xyY_to_XYZ(patch) for patch in checker.data.values()])
    xyz = xyz @ bradford(np.array(checker.illuminant)).T
    to_xyz = bradford(rgb_space.whitepoint) @ rgb_space.matrix_RGB_to_XYZ
    linear = np.clip(xyz @ np.linalg.inv(to_xyz).T, 0, 1)  # cyan is outside of sRGB
    values = rgb_space.cctf_encoding(linear) if encoded else linear
    values = values.astype(np.float32)
    return values, (rgb_space.cctf_decoding(values) if encoded else values) @ to_xyz.T


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("charts")
    corners = [(x, y) for y in range(ROWS) for x in range(COLUMNS)]
    points = [(x + i, y + j, 0) for x, y in corners for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    for space in AUTHORED:
        colors = [tuple(float(v) for v in rgb) for rgb in chart(space)[0]]
        text = STAGE.format(
            counts=[4] * 24, indices=list(range(96)), points=points, colors=colors, space=space
        )
        (folder / f"{space}.usda").write_text(text)
    return folder


@pytest.fixture(scope="module")
def rendered(stages: Path) -> Path:
    """All nine, by path tracing."""
    for space in AUTHORED:
        for rendering in RENDERED:
            image = usdmlt.render(
                stages / f"{space}.usda", width=COLUMNS * PIXELS, color_space=rendering,
                integrator="path", samples=1, depth=2, filter="box", threads=1,
            )  # fmt: skip
            image.write(stages / f"{space}.{rendering}.exr")
    return stages


def expected(authored: str, rendering: str) -> np.ndarray:
    """(24, 3) XYZ. Of the patches only cyan is outside of a space, Rec.709: no surface reflects
    less than nothing, so that its red is 0."""
    xyz = chart(authored)[1]
    to_xyz = np.array(usdmlt.color.rendering_space(rendering).to_xyz)
    inside = np.maximum(xyz @ np.linalg.inv(to_xyz).T, 0) @ to_xyz.T
    clipped = np.flatnonzero(np.abs(inside - xyz).max(axis=1) > 1e-4)
    beyond = rendering == "lin_rec709_scene" and authored != "srgb_rec709_scene"
    assert clipped.tolist() == ([CYAN] if beyond else [])
    return inside


def patches(pixels: np.ndarray) -> np.ndarray:
    """(24, 3): the mean of each patch's inner pixels; row 0 of the chart is at the bottom."""
    blocks = pixels[::-1].reshape(ROWS, PIXELS, COLUMNS, PIXELS, 3)
    return blocks[:, 1:-1, :, 1:-1].mean(axis=(1, 3)).reshape(24, 3)


@pytest.mark.parametrize("authored", AUTHORED)
@pytest.mark.parametrize("rendering", RENDERED)
def test_readers_of_chromaticities_get_the_same_xyz(
    rendered: Path, authored: str, rendering: str
) -> None:
    """Without OpenColorIO: by the primaries and the white in the file."""
    file = oiio.ImageInput.open(str(rendered / f"{authored}.{rendering}.exr"))
    numbers = np.array(file.spec().getattribute("chromaticities")).reshape(4, 2)
    matrix = bradford(numbers[3]) @ colour.normalised_primary_matrix(numbers[:3], numbers[3])
    xyz = patches(file.read_image(0, 0, 0, 3, "float")) @ matrix.T
    np.testing.assert_allclose(xyz, expected(authored, rendering), atol=1e-3)


@pytest.mark.parametrize("authored", AUTHORED)
@pytest.mark.parametrize("rendering", RENDERED)
def test_readers_with_opencolorio_get_the_same_xyz(
    rendered: Path, authored: str, rendering: str
) -> None:
    """By the space's name alone, which a configuration has to know."""
    picture = oiio.ImageBuf(str(rendered / f"{authored}.{rendering}.exr"))
    name = picture.spec().get_string_attribute("colorInteropID")
    assert name == rendering
    config = "ocio://cg-config-v1.0.0_aces-v1.3_ocio-v2.1"
    known = name.removesuffix("_scene")  # as configurations before the interop names have it
    aces = oiio.ImageBufAlgo.colorconvert(picture, known, "ACES2065-1", colorconfig=config)
    assert not aces.has_error, aces.geterror()
    ap0 = colour.RGB_COLOURSPACES["ACES2065-1"]
    matrix = bradford(ap0.whitepoint) @ ap0.matrix_RGB_to_XYZ
    xyz = patches(aces.get_pixels(oiio.FLOAT)[..., :3]) @ matrix.T
    np.testing.assert_allclose(xyz, expected(authored, rendering), atol=1e-3)
