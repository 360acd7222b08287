"""Colours arrive in the rendering colour space, white as white."""

from __future__ import annotations

import colour
import numpy as np
import pytest
from pxr import Gf, UsdLux

from usdmlt import color
from usdmlt.stage.color import ColorSpaces, canonical, decode, defined

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


@pytest.mark.parametrize("rendering", RENDERING)
def test_color_temperatures_are_the_same_light_in_every_space(read, rendering):
    body = """def SphereLight "l" {
        bool inputs:enableColorTemperature = 1
        float inputs:colorTemperature = 3000
        color3f inputs:color = (0.2, 0.9, 0.4)
    }"""
    rec709 = np.array(read(body).lights[0].radiance)
    kelvin = np.array(UsdLux.BlackbodyTemperatureAsRgb(3000))
    assert rec709 == pytest.approx(kelvin * (0.2, 0.9, 0.4), rel=1e-6)
    found = np.array(read(body, color_space=rendering).lights[0].radiance)
    assert color.conversion(rendering, "lin_rec709_scene") @ found == pytest.approx(
        rec709, abs=1e-6
    )


@pytest.mark.parametrize("name", ["srgb_rec709_scene", "raw", "lin_ciexyzd65_scene", "nonsense"])
def test_only_linear_rgb_spaces_can_be_rendered_in(read, name):
    with pytest.raises(ValueError, match="not a linear RGB colour space"):
        read("", color_space=name)


DEFINITION = """
    uniform token colorSpaceDefinition:own:name = "own_space"
    float2 colorSpaceDefinition:own:redChroma = (0.7, 0.3)
    float2 colorSpaceDefinition:own:greenChroma = (0.2, 0.7)
    float2 colorSpaceDefinition:own:blueChroma = (0.1, 0.05)
    float2 colorSpaceDefinition:own:whitePoint = (0.3457, 0.3585)
    float colorSpaceDefinition:own:gamma = 2
    float colorSpaceDefinition:own:linearBias = 0
"""


def test_a_space_that_the_stage_defines_is_converted_white_to_white(read, examine):
    """UsdColorSpaceDefinitionAPI on an ancestor; its white is D50."""
    body = MATERIAL.replace("SPACE", '( colorSpace = "own_space" )').replace(
        'def Material "M" {',
        'def Material "M" (prepend apiSchemas = ["ColorSpaceDefinitionAPI:own"]) {' + DEFINITION,
    )
    assert not any("colour space" in warning.kind for warning in examine(body).warnings)
    primaries = colour.normalised_primary_matrix(
        [[0.7, 0.3], [0.2, 0.7], [0.1, 0.05]], [0.3457, 0.3585]
    )
    to_d65 = colour.adaptation.matrix_chromatic_adaptation_VonKries(
        colour.xy_to_XYZ([0.3457, 0.3585]), colour.xy_to_XYZ([0.3127, 0.3290]), "Bradford"
    )
    to_rec709 = colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_XYZ_to_RGB
    expected = to_rec709 @ to_d65 @ primaries @ np.array([0.5, 0.25, 0.125]) ** 2
    assert read(body).materials[0].closure.diffuseColor == pytest.approx(expected, abs=1e-5)
    white = read(body.replace("0.5, 0.25, 0.125", "1, 1, 1")).materials[0].closure.diffuseColor
    assert white == pytest.approx((1, 1, 1), abs=1e-6)


@pytest.mark.parametrize(("gamma", "bias"), [(2.4, 0.055), (1 / 0.45, 0.099), (1.8, 0.0)])
def test_defined_transfer_curves_are_openusds(gamma, bias):
    space = Gf.ColorSpace(
        "own", Gf.Vec2f(0.64, 0.33), Gf.Vec2f(0.3, 0.6), Gf.Vec2f(0.15, 0.06),
        Gf.Vec2f(0.3127, 0.329), gamma, bias,
    )  # fmt: skip
    linear = Gf.ColorSpace("lin_rec709_scene")
    values = np.linspace(0, 1, 41)
    expected = [linear.Convert(space, Gf.Vec3f(v)).GetRGB()[0] for v in values]
    assert decode(values, defined(space)) == pytest.approx(expected, abs=2e-5)


def test_aliases_mean_known_spaces():
    assert canonical("ACEScg") == "lin_ap1_scene"
    assert canonical("none") == "raw"
    assert canonical("nonsense") is None


def test_srgb_decoding_is_that_of_the_standard():
    encoded = np.array([0.0, 0.04045, 0.5, 1.0])
    assert decode(encoded, "srgb_rec709_scene") == pytest.approx(
        [0, 0.0031308, 0.21404114, 1], abs=1e-7
    )
