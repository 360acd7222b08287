"""UsdRender vars become layers of the picture."""

from __future__ import annotations

import numpy as np
import pytest

import usdmlt
from usdmlt import layers

STAGE = """
def RenderSettings "r" {{
    rel products = [</r/p>]
    def RenderProduct "p" {{ rel orderedVars = [{targets}] }}
    {variables}
}}
def Camera "camera" {{ double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
def Mesh "quad" {{
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    color3f[] primvars:tint = [(0.25, 0.5, 0.75)] (interpolation = "constant")
    float2[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
}}
def SphereLight "key" {{ string primvars:usdmlt:lightGroup = "key"
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
"""


def stage_with(**variables: str) -> str:
    """Render vars by the names of their prims."""
    return STAGE.format(
        targets=", ".join(f"</r/{name}>" for name in variables),
        variables="\n".join(
            f'def RenderVar "{name}" {{ {body} }}' for name, body in variables.items()
        ),
    )


def raw(name: str, more: str = "") -> str:
    return f'uniform string sourceName = "{name}"\n{more}'


def of_type(kind: str, name: str) -> str:
    return raw(name, f'uniform token sourceType = "{kind}"')


def asked(scene) -> dict[str, layers.Layer]:
    return {layer.name: layer for layer in scene.settings.get("aovs", ())}


def test_sources_of_all_types_are_layers(read):
    found = asked(
        read(
            stage_with(
                beauty=raw("Ci"),
                coverage=raw("a"),
                depth=raw("depth"),
                normals=raw("Nn"),
                tint=of_type("primvar", "primvars:tint"),
                caustic=of_type("lpe", "LS+DE"),
                all=of_type("lpe", "C.*[LO]"),
                key=raw("lpe:C.*<L.'key'>"),
                objectId=of_type("intrinsic", ""),
            )
        )
    )
    shown = {name: (layer.source, layer.shows) for name, layer in found.items()}
    assert shown == {
        "Z": ("centre", "Z"),
        "N": ("centre", "N"),
        "tint": ("centre", "primvars:tint"),
        "caustic": ("paths", "LS+DE"),
        "key": ("paths", "C.*<L.'key'>"),
        "objectId": ("centre", "objectId"),
    }


def test_the_data_type_says_whether_a_file_has_half_floats(read):
    found = asked(
        read(
            stage_with(
                albedo=raw("albedo", 'uniform token dataType = "color3f"'),
                N=raw("N"),
                P=raw("P", 'uniform token dataType = "half3"'),
                Z=raw("Z", 'uniform token dataType = "float"'),
                direct=raw("direct", 'uniform token dataType = "color3h"'),
            )
        )
    )
    half = {name: layer.half for name, layer in found.items()}
    assert half == {"albedo": False, "N": True, "P": True, "Z": False, "direct": True}


def test_a_var_may_be_called_otherwise(read):
    name = 'string driver:parameters:aov:name = "normal_world"'
    layer = asked(read(stage_with(N=raw("N", name))))["normal_world"]
    assert (layer.shows, layer.channels[0]) == ("N", "normal_world.X")
    image = usdmlt.render(read(stage_with(N=raw("N", name)), width=8), samples=1)
    assert np.abs(image["normal_world"]).max() == 1


def test_what_cannot_be_made_is_a_warning(examine):
    text = stage_with(
        lost=raw("speedOfLight"),
        broken=of_type("lpe", "C<RD"),
        N=raw("N"),
        again=raw("N"),
    )
    warnings = {w.kind: w.paths for w in examine(text).warnings}
    lost, broken = warnings["render vars that cannot be made are left out"]
    assert lost == "/r/lost (there is no layer speedOfLight)"
    assert broken.startswith("/r/broken (light path expression 'C<RD', character 2: < is never")
    assert warnings["of several render vars of one name the first counts"] == ["/r/again"]


def test_layers_are_rendered_as_the_stage_asks(read):
    text = stage_with(
        tint=of_type("primvar", "tint"),
        uv=raw("st"),
        key=of_type("lpe", "C.*<L.'key'>"),
        rest=of_type("lpe", "C.*<L.[^'key']>"),
    )
    image = usdmlt.render(read(text, width=32), samples=4)
    shape = (image.height, image.width)
    assert image["tint"].shape == (*shape, 3) and image["uv"].shape == (*shape, 2)
    inside = image["tint"][..., 0] > 0
    assert inside.any()
    np.testing.assert_allclose(
        image["tint"][inside], np.tile([0.25, 0.5, 0.75], (inside.sum(), 1)), rtol=1e-6
    )
    np.testing.assert_array_equal(image["key"], image["color"])
    assert not image["rest"].any()
    asked_for = usdmlt.render(read(text, width=8), samples=1, aovs=["N"])
    assert "N" in asked_for.channels and "tint" not in asked_for.channels


@pytest.mark.parametrize(
    "attribute",
    [
        "string primvars:usdmlt:lightGroup",
        "string inputs:karma:light:lpetag",
        "string ri:light:lightGroup",
        "string primvars:arnold:aov",
    ],
)
def test_groups_of_lights_are_read_as_other_renderers_write_them(read, attribute):
    scene = read(f'def SphereLight "l" {{ {attribute} = "rim" }}\ndef RectLight "other" {{}}')
    assert [light.light_group for light in scene.lights] == ["rim", ""]


def test_meshes_have_groups_too_as_lights_or_as_what_glows(read):
    quad = """point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]"""
    lamp, glow = read(f"""
def Mesh "lamp" (prepend apiSchemas = ["MeshLightAPI"]) {{
    string inputs:karma:light:lpetag = "lamps"
    {quad}
}}
def Mesh "glow" {{
    string primvars:karma:object:lpetag = "glows"
    {quad}
}}""").meshes
    assert (lamp.light_group, lamp.is_light) == ("lamps", True)
    assert (glow.light_group, glow.is_light) == ("glows", False)
