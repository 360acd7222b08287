"""Materials: UsdPreviewSurface, render contexts, and networks that cannot be rendered."""

from __future__ import annotations

import pytest

from support.scattering import probe_material
from support.shapes import at_corners
from usdmlt.errors import Error
from usdmlt.scene import PreviewSurface, PrimvarInput

MATERIAL = """
def Material "M" {
    token outputs:surface.connect = </M/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        INPUTS
        token outputs:surface
    }
    NODES
}
def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }
"""


@pytest.fixture
def material(read):
    """The material of a stage whose UsdPreviewSurface has the given inputs."""

    def read_material(inputs: str = "", nodes: str = "", **options):
        scene = read(MATERIAL.replace("INPUTS", inputs).replace("NODES", nodes), **options)
        return scene.materials[scene.meshes[0].materials]

    return read_material


def test_the_schema_defaults(material):
    assert material().closure == PreviewSurface()
    assert material().name == "/M"
    assert (material().opacity, material().opacity_threshold, material().normal) == (1, 0, None)


def test_every_input_is_read(material):
    closure = material("""
        color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
        color3f inputs:emissiveColor = (4, 5, 6)
        int inputs:useSpecularWorkflow = 1
        color3f inputs:specularColor = (0.7, 0.8, 0.9)
        float inputs:metallic = 0.25
        float inputs:roughness = 0.5
        float inputs:clearcoat = 0.75
        float inputs:clearcoatRoughness = 0.125
        float inputs:ior = 1.25
    """).closure
    assert closure.diffuseColor == pytest.approx((0.1, 0.2, 0.3))
    assert closure.emissiveColor == (4, 5, 6)
    assert closure.useSpecularWorkflow == 1
    assert closure.specularColor == pytest.approx((0.7, 0.8, 0.9))
    assert (closure.metallic, closure.roughness) == (0.25, 0.5)
    assert (closure.clearcoat, closure.clearcoatRoughness, closure.ior) == (0.75, 0.125, 1.25)


@pytest.mark.parametrize("mode", ["", 'token inputs:opacityMode = "transparent"'])
def test_transparent_opacity_belongs_to_the_closure(material, mode):
    found = material("float inputs:opacity = 0.25\n" + mode)
    assert (found.closure.opacity, found.opacity, found.opacity_threshold) == (0.25, 1, 0)


def test_presence_is_coverage(material):
    found = material('float inputs:opacity = 0.25\ntoken inputs:opacityMode = "presence"')
    assert (found.closure.opacity, found.opacity, found.opacity_threshold) == (1, 0.25, 0)


def test_a_threshold_is_a_cut_out_in_either_mode(material):
    for mode in ("transparent", "presence"):
        found = material(f"""float inputs:opacity = 0.25
            float inputs:opacityThreshold = 0.5
            token inputs:opacityMode = "{mode}" """)
        assert (found.closure.opacity, found.opacity, found.opacity_threshold) == (1, 0.25, 0.5)


READER = """
    def Shader "p" {
        uniform token info:id = "UsdPrimvarReader_KIND"
        string inputs:varname = "weight"
        FALLBACK
        float outputs:result
    }
"""


def test_primvar_readers_feed_inputs(material):
    nodes = READER.replace("KIND", "float").replace("FALLBACK", "float inputs:fallback = 0.5")
    found = material("float inputs:roughness.connect = </M/p.outputs:result>", nodes)
    assert found.closure.roughness == PrimvarInput("weight", 0.5)
    nodes = READER.replace("KIND", "float3").replace(
        "FALLBACK", "float3 inputs:fallback = (1, 2, 3)"
    )
    found = material("color3f inputs:diffuseColor.connect = </M/p.outputs:result>", nodes)
    assert found.closure.diffuseColor == PrimvarInput("weight", (1, 2, 3))


NUMBERS = "(0.25, 0.5, 0.75)"
# Of each kind of reader: the primvar's type and value, and the same as a number of an input.
KINDS = {
    "float": ("float", "0.25", "float inputs:roughness = 0.25"),
    "int": ("int", "1", "float inputs:metallic = 1"),
    "float3": ("color3f", NUMBERS, f"color3f inputs:emissiveColor = {NUMBERS}"),
    "float4": ("color4f", "(0.25, 0.5, 0.75, 1)", f"color3f inputs:emissiveColor = {NUMBERS}"),
    "normal": ("normal3f", NUMBERS, f"color3f inputs:emissiveColor = {NUMBERS}"),
    "point": ("point3f", NUMBERS, f"color3f inputs:emissiveColor = {NUMBERS}"),
    "vector": ("vector3f", NUMBERS, f"color3f inputs:emissiveColor = {NUMBERS}"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_reader_means_the_same_as_a_constant(read, kind):
    type_name, value, constant = KINDS[kind]
    plain = MATERIAL.replace("INPUTS", constant).replace("NODES", "")
    nodes = READER.replace("KIND", kind).replace("FALLBACK", "").replace("float outputs", "#")
    feeds = constant.split(" = ")[0] + ".connect = </M/p.outputs:result>"
    body = MATERIAL.replace("INPUTS", feeds).replace("NODES", nodes)
    primvar = f"{type_name}[] primvars:weight = [{value}] ( interpolation = 'constant' )"
    body = body.replace("rel material:binding", primvar + "\nrel material:binding")
    scene = read(body)
    corners = at_corners(scene.meshes[0].primvars["weight"], scene.meshes[0])[0]
    found = probe_material(scene.materials[0], [], {"weight": corners})
    expected = probe_material(read(plain).materials[0], [], {})
    assert found.lobes == expected.lobes
    assert found.emission == expected.emission
    nothing = probe_material(read(MATERIAL.replace("INPUTS", "").replace("NODES", "")).materials[0])
    assert (nothing.lobes, nothing.emission) != (expected.lobes, expected.emission)


def test_outputs_need_not_be_declared(material):
    nodes = READER.replace("KIND", "float").replace("FALLBACK", "").replace("float outputs", "#")
    found = material("float inputs:roughness.connect = </M/p.outputs:result>", nodes)
    assert found.closure.roughness == PrimvarInput("weight", 0.0)


def test_material_inputs_may_be_animated(read):
    body = MATERIAL.replace("INPUTS", "float inputs:roughness.timeSamples = { 1: 0, 3: 1 }")
    scene = read(body.replace("NODES", ""), frame=2)
    assert scene.materials[0].closure.roughness == 0.5


# ---------------------------------------------------------------------------------------------
# Broken and unknown networks: a warning, and the mesh's displayColor


def fallback_and_warning(read, examine, body):
    scene = read(body)
    assert scene.materials[scene.meshes[0].materials].name == "displayColor"
    with pytest.raises(Error):
        read(body, strict=True)
    return [str(w) for w in examine(body).warnings if "no lights" not in w.kind]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("material:binding = </M>", "material:binding = </Gone>", "missing: /c (/Gone)"),
        ('"UsdPreviewSurface"', '"FancySurface"', "type FancySurface are not rendered: /M/s"),
        ("</M/s.outputs:surface>", "</M/gone.outputs:surface>", "connected to nothing: /M.outputs"),
        ("token outputs:surface.connect = </M/s.outputs:surface>", "", "without a surface: /M"),
        ("outputs:surface.connect", "outputs:ri:surface.connect", "other renderers only (ri): /M"),
        (
            "</M/s.outputs:surface>",
            "</M.outputs:surface>",
            "go round in a circle: /M.outputs:surface",
        ),
    ],
)
def test_a_material_that_cannot_be_rendered(read, examine, old, new, says):
    body = MATERIAL.replace("INPUTS", "").replace("NODES", "")
    assert old in body
    warnings = fallback_and_warning(read, examine, body.replace(old, new))
    assert len(warnings) == 1
    assert says in warnings[0]


CIRCLES = {
    "interfaces": (
        "float inputs:roughness.connect = </M/g.outputs:o>",
        """def NodeGraph "g" {
            float outputs:o.connect = </M/g.outputs:p>
            float outputs:p.connect = </M/g.outputs:o>
        }""",
    ),
    "texture coordinates": (
        "color3f inputs:diffuseColor.connect = </M/t.outputs:rgb>",
        """def Shader "t" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @stage.usda@
            float2 inputs:st.connect = </M/x.outputs:result>
            float3 outputs:rgb
        }
        def Shader "x" {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </M/x.outputs:result>
            float2 outputs:result
        }""",
    ),
    "readers": (
        "float inputs:roughness.connect = </M/p.outputs:result>",
        """def Shader "p" {
            uniform token info:id = "UsdPrimvarReader_float"
            string inputs:varname = "weight"
            float inputs:fallback.connect = </M/p.outputs:result>
            float outputs:result
        }""",
    ),
}


@pytest.mark.parametrize("circle", ["interfaces", "readers"])
def test_networks_that_go_round_in_a_circle(read, examine, circle):
    inputs, nodes = CIRCLES[circle]
    body = MATERIAL.replace("INPUTS", inputs).replace("NODES", nodes)
    warnings = fallback_and_warning(read, examine, body)
    assert any("circle" in warning for warning in warnings)


def test_texture_coordinates_that_go_round_in_a_circle(read, examine, tmp_path):
    import numpy as np
    import OpenImageIO as oiio

    oiio.ImageBuf(np.zeros((2, 2, 3), np.float32)).write(str(tmp_path / "image.png"))
    inputs, nodes = CIRCLES["texture coordinates"]
    body = MATERIAL.replace("INPUTS", inputs).replace(
        "NODES", nodes.replace("stage.usda", "image.png")
    )
    warnings = fallback_and_warning(read, examine, body)
    assert any("circle: /M/x" in warning for warning in warnings)


def test_unknown_nodes_give_the_default_with_a_warning(material, examine):
    inputs = "float inputs:roughness.connect = </M/n.outputs:out>"
    node = """def Shader "n" {
        uniform token info:id = "SparklyNoise"
        float outputs:out
    }"""
    assert material(inputs, node).closure.roughness == 0.5
    found = examine(MATERIAL.replace("INPUTS", inputs).replace("NODES", node))
    assert any("SparklyNoise" in w.kind and w.paths == ["/M/n"] for w in found.warnings)


def test_connections_to_nothing_give_the_authored_value_or_the_default(material, examine):
    inputs = """
        float inputs:roughness.connect = </M/gone.outputs:out>
        float inputs:metallic = 0.25
        float inputs:metallic.connect = </M/gone.outputs:out>
    """
    closure = material(inputs).closure
    assert (closure.roughness, closure.metallic) == (0.5, 0.25)
    found = examine(MATERIAL.replace("INPUTS", inputs).replace("NODES", ""))
    assert any("connected to nothing" in w.kind and len(w.paths) == 2 for w in found.warnings)


def test_plain_inputs_of_the_wrong_type_are_ignored_with_a_warning(material, examine):
    inputs = 'string inputs:opacityThreshold = "half"\nstring inputs:useSpecularWorkflow = "no"'
    found = material(inputs)
    assert (found.opacity_threshold, found.closure.useSpecularWorkflow) == (0, 0)
    warnings = examine(MATERIAL.replace("INPUTS", inputs).replace("NODES", "")).warnings
    assert any("wrong type" in w.kind and w.paths == ["/M/s"] for w in warnings)


def test_not_finite_inputs_are_an_error_with_their_path(material):
    with pytest.raises(Error, match=r"/M/s\.inputs:roughness: not a finite value"):
        material("float inputs:roughness = nan")


def test_volumes_that_are_not_known_are_warned_of(examine):
    body = MATERIAL.replace("INPUTS", "").replace("NODES", "")
    volume = body.replace(
        "token outputs:surface.connect",
        "token outputs:volume.connect = </M/s.outputs:surface>\ntoken outputs:surface.connect",
    )
    found = examine(volume)
    assert any("volume shaders" in w.kind and w.paths == ["/M/s"] for w in found.warnings)


def test_the_full_purpose_is_preferred_to_the_general_binding(read):
    scene = read("""
        def Material "A" { token outputs:surface.connect = </A/s.outputs:surface>
            def Shader "s" { uniform token info:id = "UsdPreviewSurface"
                token outputs:surface } }
        def Material "B" { token outputs:surface.connect = </B/s.outputs:surface>
            def Shader "s" { uniform token info:id = "UsdPreviewSurface"
                token outputs:surface } }
        def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            rel material:binding = </A>
            rel material:binding:full = </B>
            rel material:binding:preview = </A> }""")
    assert scene.materials[scene.meshes[0].materials].name == "/B"
