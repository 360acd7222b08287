"""MaterialX closures: nodes, inputs, combinations, and which render context is read."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import UsdLux

from support.usda import connect, mtlx_material, node
from usdmlt.scene import (
    Add,
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Layer,
    Mix,
    Multiply,
    PreviewSurface,
    PrimvarInput,
    TextureInput,
    Translucent,
    UniformEmission,
)

CUBE = 'def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }'


def shown(nodes: str = "", surface: str = connect("bsdf", "bsdf"), kind: str = "ND_surface") -> str:
    """A stage with a cube of a material; ``bsdf`` feeds the surface."""
    return mtlx_material(nodes, surface, kind) + CUBE


@pytest.fixture
def material(read):
    """The material of a stage with the given nodes; ``bsdf`` feeds the surface."""

    def read_material(nodes: str, surface: str = connect("bsdf", "bsdf")):
        scene = read(shown(nodes, surface))
        return scene.materials[scene.meshes[0].materials]

    return read_material


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("ND_oren_nayar_diffuse_bsdf", Diffuse((0.18, 0.18, 0.18), 1.0, 0.0)),
        ("ND_translucent_bsdf", Translucent((1, 1, 1), 1.0)),
        ("ND_dielectric_bsdf", Dielectric(1.5, 0.05, (1, 1, 1), 1.0, "R")),
        (
            "ND_conductor_bsdf",
            Conductor((0.183, 0.421, 1.373), (3.424, 2.346, 1.770), 0.05, 1.0),
        ),
        ("ND_generalized_schlick_bsdf", GeneralizedSchlick()),
        ("ND_uniform_edf", UniformEmission((1, 1, 1))),
    ],
)
def test_the_defaults_are_those_of_materialx(material, kind, expected):
    assert material(node("bsdf", kind)).closure == expected


def test_diffuse_inputs(material):
    closure = material(
        node(
            "bsdf",
            "ND_oren_nayar_diffuse_bsdf",
            """color3f inputs:color = (0.5, 0.25, 0.125)
            float inputs:weight = 0.75
            float inputs:roughness = 0.5""",
        )
    ).closure
    assert closure == Diffuse((0.5, 0.25, 0.125), 0.75, 0.5)


@pytest.mark.parametrize("mode", ["R", "T", "RT"])
def test_dielectric_inputs(material, mode):
    closure = material(
        node(
            "bsdf",
            "ND_dielectric_bsdf",
            f"""float inputs:ior = 1.25
            float2 inputs:roughness = (0.25, 0.5)
            color3f inputs:tint = (0.5, 0.75, 1)
            float inputs:weight = 0.5
            string inputs:scatter_mode = "{mode}" """,
        )
    ).closure
    assert closure == Dielectric(1.25, (0.25, 0.5), (0.5, 0.75, 1), 0.5, mode)


def test_indices_of_conductors_are_data_not_colors(read):
    nodes = node(
        "bsdf",
        "ND_conductor_bsdf",
        "color3f inputs:ior = (0.5, 1, 1.5)\ncolor3f inputs:extinction = (2, 3, 4)",
    )
    body = shown(nodes)
    closure = read(body, color_space="lin_ap1_scene").materials[0].closure
    assert (closure.ior, closure.extinction) == ((0.5, 1, 1.5), (2, 3, 4))


def test_schlick_inputs(material):
    closure = material(
        node(
            "bsdf",
            "ND_generalized_schlick_bsdf",
            """color3f inputs:color0 = (0.25, 0.5, 0.75)
            color3f inputs:color90 = (0.5, 0.5, 0.5)
            float inputs:exponent = 3
            float2 inputs:roughness = (0.25, 0.25)""",
        )
    ).closure
    assert closure == GeneralizedSchlick((0.25, 0.5, 0.75), (0.5, 0.5, 0.5), 3.0, 0.25)


TWO = node("a", "ND_oren_nayar_diffuse_bsdf") + node("b", "ND_dielectric_bsdf")
A, B = Diffuse(), Dielectric()


@pytest.mark.parametrize(
    ("kind", "inputs", "expected"),
    [
        ("ND_layer_bsdf", connect("top", "b") + connect("base", "a"), Layer(top=B, base=A)),
        ("ND_layer_bsdf", connect("base", "a"), A),
        (
            "ND_mix_bsdf",
            connect("fg", "b") + connect("bg", "a") + "float inputs:mix = 0.25",
            Mix(foreground=B, background=A, mix=0.25),
        ),
        ("ND_add_bsdf", connect("in1", "a") + connect("in2", "b"), Add(A, B)),
        ("ND_multiply_bsdfF", connect("in1", "a") + "float inputs:in2 = 0.5", Multiply(A, 0.5)),
        (
            "ND_multiply_bsdfC",
            connect("in1", "a") + "color3f inputs:in2 = (1, 0.5, 0)",
            Multiply(A, (1, 0.5, 0)),
        ),
    ],
)
def test_combinations(material, kind, inputs, expected):
    assert material(TWO + node("bsdf", kind, inputs)).closure == expected


def test_what_is_not_connected_is_black(material):
    closure = material(TWO + node("bsdf", "ND_add_bsdf", connect("in1", "a"))).closure
    assert closure == Add(A, Diffuse(color=(0, 0, 0), weight=0.0))


def test_emission_adds_to_scattering(material):
    nodes = TWO + node("e", "ND_uniform_edf", "color3f inputs:color = (2, 3, 4)")
    found = material(
        nodes, connect("bsdf", "a") + connect("edf", "e") + "float inputs:opacity = 0.5"
    )
    assert found.closure == Add(A, UniformEmission((2, 3, 4)))
    assert found.opacity == 0.5
    assert material(nodes, connect("edf", "e")).closure == UniformEmission((2, 3, 4))


def test_a_surface_without_closures_absorbs(material):
    assert material("", "").closure is None


def test_closures_are_read_through_node_graphs_and_interfaces(read):
    scene = read("""
        def Material "M" {
            float inputs:depth = 0.25
            token outputs:mtlx:surface.connect = </M/g.outputs:surface>
            def NodeGraph "g" {
                float inputs:depth.connect = </M.inputs:depth>
                token outputs:surface.connect = </M/g/surface.outputs:out>
                def Shader "surface" {
                    uniform token info:id = "ND_surface"
                    token inputs:bsdf.connect = </M/g/bsdf.outputs:out>
                    token outputs:out
                }
                def Shader "bsdf" {
                    uniform token info:id = "ND_oren_nayar_diffuse_bsdf"
                    float inputs:weight.connect = </M/g.inputs:depth>
                    token outputs:out
                }
            }
        }
        def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            rel material:binding = </M> }""")
    assert scene.materials[0].closure == Diffuse(weight=0.25)


def test_patterns_feed_closures(material):
    nodes = (
        node("k", "ND_constant_color3", "color3f inputs:value = (0.5, 0.5, 1)")
        + node("v", "ND_convert_color3_vector3", connect("in", "k", "color3f"))
        + node("p", "ND_geompropvalue_float", 'string inputs:geomprop = "depth"')
        + node(
            "bsdf",
            "ND_oren_nayar_diffuse_bsdf",
            connect("color", "v", "color3f") + connect("weight", "p", "float"),
        )
    )
    assert material(nodes).closure == Diffuse((0.5, 0.5, 1), PrimvarInput("depth", 0.0))


def test_anisotropy(material):
    nodes = node(
        "r",
        "ND_roughness_anisotropy",
        "float inputs:roughness = 0.5\nfloat inputs:anisotropy = 0.75",
    ) + node("bsdf", "ND_conductor_bsdf", connect("roughness", "r", "float2"))
    assert material(nodes).closure.roughness == pytest.approx((0.5, 0.125))


def test_anisotropic_meshes_keep_the_coordinates_their_grooves_follow(read):
    nodes = node("bsdf", "ND_conductor_bsdf", "float2 inputs:roughness = (0.5, 0.25)")
    body = shown(nodes)
    assert set(read(body).meshes[0].primvars) == {"st"}


@pytest.fixture
def image(tmp_path):
    oiio.ImageBuf(np.full((2, 2, 3), 0.5, np.float32)).write(str(tmp_path / "image.png"), "uint8")


@pytest.mark.parametrize(
    ("space", "expected"), [('( colorSpace = "srgb_texture" )', 0.21586), ("", 128 / 255)]
)
def test_images(read, image, space, expected):
    nodes = node(
        "i",
        "ND_tiledimage_color3",
        f"""asset inputs:file = @image.png@ {space}
        float2 inputs:uvtiling = (2, 3)
        string inputs:vaddressmode = "clamp" """,
    ) + node("bsdf", "ND_oren_nayar_diffuse_bsdf", connect("color", "i", "color3f"))
    scene = read(shown(nodes))
    color = scene.materials[0].closure.color
    assert isinstance(color, TextureInput)
    assert color.primvar == "st"
    assert color.transform[:, :2].tolist() == [[2, 0], [0, 3]]
    texture = scene.textures[color.texture]
    # MaterialX repeats where USD's own texture node shows black.
    assert (texture.wrap_s, texture.wrap_t) == ("repeat", "clamp")
    assert texture.linear()[0, 0, 0] == pytest.approx(expected, rel=1e-3)


def test_normal_maps(read, image):
    nodes = (
        node("i", "ND_image_vector3", "asset inputs:file = @image.png@")
        + node("n", "ND_normalmap", connect("in", "i", "float3"))
        + node("bsdf", "ND_oren_nayar_diffuse_bsdf", connect("normal", "n", "float3"))
    )
    scene = read(shown(nodes))
    normal = scene.materials[0].normal
    assert (normal.scale, normal.bias) == ((2, 2, 2, 1), (-1, -1, -1, 0))


UNIVERSAL = """
    token outputs:surface.connect = </M/preview.outputs:surface>
    def Shader "preview" {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:roughness = 0.75
        token outputs:surface
    }
"""


def test_the_materialx_context_comes_before_the_universal_one(material):
    assert material(node("bsdf", "ND_dielectric_bsdf") + UNIVERSAL).closure == Dielectric()


@pytest.mark.parametrize(
    "nodes",
    [
        node("bsdf", "ND_chiang_hair_bsdf"),
        node("bsdf", "ND_layer_bsdf", connect("top", "bsdf") + connect("base", "bsdf")),
        node("noise", "ND_worleynoise3d_float")
        + node("bsdf", "ND_dielectric_bsdf", connect("weight", "noise", "float")),
    ],
)
def test_graphs_that_cannot_be_rendered_leave_it_to_the_universal_context(material, nodes):
    assert material(nodes + UNIVERSAL).closure == PreviewSurface(roughness=0.75)


def test_a_surface_shader_that_is_not_known_leaves_it_to_the_universal_context(read):
    scene = read(shown(UNIVERSAL, "", "ND_disney_principled_surfaceshader"))
    assert scene.materials[0].closure == PreviewSurface(roughness=0.75)


@pytest.mark.parametrize(
    ("nodes", "says"),
    [
        (node("bsdf", "ND_chiang_hair_bsdf"), "ND_chiang_hair_bsdf are not rendered: /M/bsdf"),
        (
            node("bsdf", "ND_layer_bsdf", connect("top", "bsdf") + connect("base", "bsdf")),
            "circle: /M/bsdf",
        ),
    ],
)
def test_graphs_that_cannot_be_rendered_are_warned_of(read, examine, nodes, says):
    body = shown(nodes)
    assert read(body).materials[0].name == "displayColor"
    assert any(says in str(w) for w in examine(body).warnings)


def test_materialx_preview_surfaces_are_read_like_usds(read):
    kind = "ND_UsdPreviewSurface_surfaceshader"
    scene = read(shown(surface="float inputs:roughness = 0.25", kind=kind))
    assert scene.materials[0].closure == PreviewSurface(roughness=0.25)


def test_unlit_surfaces_only_emit(read):
    surface = """float inputs:emission = 2
        color3f inputs:emission_color = (0.5, 1, 0.25)
        float inputs:transmission = 0.5
        float inputs:opacity = 0.5"""
    scene = read(shown(surface=surface, kind="ND_surface_unlit"))
    assert scene.materials[0].closure == UniformEmission((1.0, 2.0, 0.5))
    assert scene.materials[0].opacity == 0.25


def test_lobes_that_are_too_many_leave_it_to_the_universal_context(material):
    lobes = "".join(
        node(f"d{i}", "ND_oren_nayar_diffuse_bsdf")
        + node(
            "bsdf" if i == 8 else f"s{i}",
            "ND_add_bsdf",
            connect("in1", f"d{i}") + connect("in2", f"s{i - 1}" if i else "d9"),
        )
        for i in range(9)
    )
    lobes += node("d9", "ND_translucent_bsdf")
    assert material(lobes + UNIVERSAL).closure == PreviewSurface(roughness=0.75)


def test_blackbodies_have_usds_colour(read):
    nodes = node("edf", "ND_uniform_edf", connect("color", "hot", "color3f"))
    nodes += node("hot", "ND_blackbody", "float inputs:temperature = 3000")
    body = shown(nodes, connect("edf", "edf"))
    color = read(body).materials[0].closure.color
    assert color == pytest.approx(UsdLux.BlackbodyTemperatureAsRgb(3000))
    assert np.dot(color, (0.2126, 0.7152, 0.0722)) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("mode", "ior", "thin"), [("R", 1.5, True), ("T", 1.0, True), ("T", 1.5, False)]
)
def test_thin_walls_of_closures_are_solids_where_they_refract(read, examine, mode, ior, thin):
    nodes = node("bsdf", "ND_add_bsdf", connect("in1", "glass") + connect("in2", "cloth"))
    nodes += node("cloth", "ND_translucent_bsdf")
    glass = f'string inputs:scatter_mode = "{mode}"\nfloat inputs:ior = {ior}'
    nodes += node("glass", "ND_dielectric_bsdf", glass)
    surface = connect("bsdf", "bsdf") + "bool inputs:thin_walled = true"
    body = shown(nodes, surface)
    assert read(body).materials[0].thin_walled == thin
    assert any("as solids" in w.kind for w in examine(body).warnings) != thin
