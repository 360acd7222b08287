"""Colours arrive in the rendering colour space, white as white."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf

from usdmlt.stage.color import ColorSpaces, canonical, decode

RENDERING = [
    "lin_rec709_scene",
    "lin_ap1_scene",
    "lin_rec2020_scene",
    "lin_p3d65_scene",
    "lin_ap0_scene",
]

MATERIAL = """
def Material "M" {
    token outputs:surface.connect = </M/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.5, 0.25, 0.125) SPACE
        token outputs:surface
    }
}
def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }
"""


def diffuse(read, space: str, **options) -> np.ndarray:
    scene = read(MATERIAL.replace("SPACE", space), **options)
    return np.array(scene.materials[0].closure.diffuseColor)


def test_untagged_colors_are_linear_rec709(read):
    assert diffuse(read, "") == pytest.approx([0.5, 0.25, 0.125])


@pytest.mark.parametrize("rendering", RENDERING)
def test_white_stays_white(rendering):
    colors = ColorSpaces(rendering)
    for space in ("lin_rec709_scene", "srgb_rec709_scene", "lin_ap1_scene", "g22_adobergb_scene"):
        assert colors.convert(np.ones(3), space) == pytest.approx(np.ones(3), abs=1e-5)


@pytest.mark.parametrize("space", ["srgb_rec709_scene", "srgb_texture", "sRGB"])
def test_a_color_tagged_srgb_is_decoded(read, space):
    expected = ((np.array([0.5, 0.25, 0.125]) + 0.055) / 1.055) ** 2.4
    assert diffuse(read, f'( colorSpace = "{space}" )') == pytest.approx(expected, rel=1e-5)


def test_acescg_is_converted_as_published(read):
    # AP1 to Rec.709 with the Bradford transform, as ACES has it.
    matrix = np.array(
        [
            [1.70505, -0.62179, -0.08326],
            [-0.13026, 1.14080, -0.01055],
            [-0.02400, -0.12897, 1.15297],
        ]
    )
    expected = matrix @ (0.5, 0.25, 0.125)
    assert diffuse(read, '( colorSpace = "acescg" )') == pytest.approx(expected, abs=2e-4)


def test_a_tagged_color_passes_through_its_own_rendering_space(read):
    found = diffuse(read, '( colorSpace = "lin_ap1_scene" )', color_space="lin_ap1_scene")
    assert found == pytest.approx([0.5, 0.25, 0.125])


@pytest.mark.parametrize("rendering", RENDERING)
def test_rendering_spaces_agree_on_what_the_color_is(read, rendering):
    found = diffuse(read, "", color_space=rendering)
    xyz = np.array(Gf.ColorSpace(rendering).GetRGBToXYZ()) @ found
    expected = np.array(Gf.ColorSpace("lin_rec709_scene").GetRGBToXYZ()) @ (0.5, 0.25, 0.125)
    assert xyz == pytest.approx(expected, abs=1e-5)


def test_the_color_space_of_a_prim_holds_for_what_is_below(read):
    body = MATERIAL.replace("SPACE", "").replace(
        'def Material "M" {',
        'def Material "M" (prepend apiSchemas = ["ColorSpaceAPI"]) {'
        '\nuniform token colorSpace:name = "g22_rec709_scene"',
    )
    found = read(body).materials[0].closure.diffuseColor
    assert found == pytest.approx(np.array([0.5, 0.25, 0.125]) ** 2.2, rel=1e-4)


def test_raw_colors_are_left_alone(read):
    found = diffuse(read, '( colorSpace = "raw" )', color_space="lin_ap1_scene")
    assert found == pytest.approx([0.5, 0.25, 0.125])


def test_an_unknown_space_is_read_as_rec709_with_a_warning(read, examine):
    assert diffuse(read, '( colorSpace = "mystery" )') == pytest.approx([0.5, 0.25, 0.125])
    found = examine(MATERIAL.replace("SPACE", '( colorSpace = "mystery" )'))
    assert any("mystery" in w.kind for w in found.warnings)


def test_display_color_is_converted_too(read):
    scene = read(
        """def Mesh "m" { QUAD
        color3f[] primvars:displayColor = [(1, 0, 0)] ( interpolation = "constant" ) }""",
        color_space="lin_ap1_scene",
    )
    red = scene.meshes[0].primvars["displayColor"].values[0]
    assert red == pytest.approx([0.61312, 0.07019, 0.02062], abs=2e-4)


def test_light_colors_are_converted_too(read):
    scene = read(
        'def SphereLight "l" { color3f inputs:color = (1, 0, 0)\nfloat inputs:intensity = 2 }',
        color_space="lin_ap1_scene",
    )
    assert scene.lights[0].radiance == pytest.approx([1.22624, 0.14038, 0.04124], abs=4e-4)


@pytest.mark.parametrize("name", ["srgb_rec709_scene", "raw", "lin_ciexyzd65_scene", "nonsense"])
def test_only_linear_rgb_spaces_can_be_rendered_in(read, name):
    with pytest.raises(ValueError, match="not a linear RGB colour space"):
        read("", color_space=name)


def test_aliases_mean_known_spaces():
    assert canonical("ACEScg") == "lin_ap1_scene"
    assert canonical("none") == "raw"
    assert canonical("nonsense") is None


def test_srgb_decoding_is_that_of_the_standard():
    encoded = np.array([0.0, 0.04045, 0.5, 1.0])
    assert decode(encoded, "srgb_rec709_scene") == pytest.approx(
        [0, 0.0031308, 0.21404114, 1], abs=1e-7
    )
