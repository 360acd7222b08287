"""UsdUVTexture: colour spaces, wrapping, scale and bias, fallbacks, transforms, packages."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import UsdUtils

from support.scattering import probe_material
from usdmlt.errors import Error
from usdmlt.stage import inspect, load

BODY = """
def Material "M" {
    token outputs:surface.connect = </M/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        INPUT
        token outputs:surface
    }
    def Shader "t" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @FILE@
        float2 inputs:st.connect = </M/STNODE>
        TEXTURE
        float3 outputs:rgb
        float outputs:r
        float outputs:g
        float outputs:b
        float outputs:a
    }
    def Shader "st" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
    NODES
}
def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"]) { QUAD
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    rel material:binding = </M> }
"""
DIFFUSE = "color3f inputs:diffuseColor.connect = </M/t.outputs:rgb>"


def body(file="image.png", texture="", feeds=DIFFUSE, nodes="", st="st.outputs:result"):
    """A stage with one textured material."""
    text = BODY.replace("FILE", file).replace("TEXTURE", texture).replace("INPUT", feeds)
    return text.replace("NODES", nodes).replace("STNODE", st)


@pytest.fixture
def image(tmp_path):
    """Write an image beside the stage."""

    def write_image(pixels, name="image.png", **attributes):
        pixels = np.ascontiguousarray(pixels)
        kind = {"u1": "uint8", "u2": "uint16", "f2": "half", "f4": "float"}[pixels.dtype.str[1:]]
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
        spec.attribute("oiio:UnassociatedAlpha", 1)
        for key, value in attributes.items():
            spec.attribute(key, value)
        output = oiio.ImageOutput.create(str(tmp_path / name))
        assert output.open(str(tmp_path / name), spec), output.geterror()
        assert output.write_image(pixels)
        output.close()
        return tmp_path / name

    return write_image


def solid(*values, dtype=np.uint8, size=(2, 3)):
    return np.broadcast_to(np.array(values, dtype=dtype), (*size, len(values)))


SRGB_HALF = 0.21586  # sRGB 128/255


@pytest.mark.parametrize(
    ("name", "pixels", "space", "expected"),
    [
        # auto: 8 bits and three or four channels are sRGB
        ("rgb.png", solid(128, 128, 128), "auto", SRGB_HALF),
        ("rgba.png", solid(128, 128, 128, 128), "auto", SRGB_HALF),
        ("rgb.jpg", solid(128, 128, 128), "auto", SRGB_HALF),
        ("rgb.tga", solid(128, 128, 128), "auto", SRGB_HALF),
        # one and two channels, 16 bits and floats are not
        ("grey.png", solid(128), "auto", 128 / 255),
        ("greya.png", solid(128, 255), "auto", 128 / 255),
        ("deep.png", solid(32768, 32768, 32768, dtype=np.uint16), "auto", 32768 / 65535),
        ("half.exr", solid(0.5, 0.5, 0.5, dtype=np.float16), "auto", 0.5),
        # declared
        ("rgb.png", solid(128, 128, 128), "raw", 128 / 255),
        ("grey.png", solid(128), "sRGB", SRGB_HALF),
        ("deep.png", solid(32768, 32768, 32768, dtype=np.uint16), "sRGB", 0.21405),
        ("half.exr", solid(0.5, 0.5, 0.5, dtype=np.float16), "sRGB", 0.21404),
    ],
)
def test_the_color_space_rule(read, image, name, pixels, space, expected):
    image(pixels, name)
    scene = read(body(name, f'token inputs:sourceColorSpace = "{space}"'))
    assert scene.textures[0].pixels.dtype == pixels.dtype
    assert scene.textures[0].linear()[0, 0, 0] == pytest.approx(expected, rel=1e-3)


def test_without_a_declaration_the_rule_is_auto(read, image):
    image(solid(128, 128, 128))
    assert read(body()).textures[0].linear()[0, 0, 0] == pytest.approx(SRGB_HALF, rel=1e-3)


def test_the_color_space_of_the_file_attribute_counts_unless_declared_otherwise(read, image):
    image(solid(128, 128, 128))
    tagged = body().replace("@image.png@", '@image.png@ ( colorSpace = "lin_rec709" )')
    assert read(tagged).textures[0].linear()[0, 0, 0] == pytest.approx(128 / 255, rel=1e-3)
    declared = tagged.replace(
        "float3 outputs:rgb", 'token inputs:sourceColorSpace = "sRGB"\nfloat3 outputs:rgb'
    )
    assert read(declared).textures[0].linear()[0, 0, 0] == pytest.approx(SRGB_HALF, rel=1e-3)


def test_primaries_are_converted_for_colors_but_not_for_data(read, image):
    image(solid(255, 0, 0))
    color = read(body(), color_space="lin_ap1_scene").textures[0].linear()[0, 0]
    assert color == pytest.approx([0.61312, 0.07019, 0.02062], abs=1e-3)
    scalar = body(feeds="float inputs:roughness.connect = </M/t.outputs:r>")
    assert read(scalar, color_space="lin_ap1_scene").textures[0].linear()[0, 0, 0] == 1
    raw = body(texture='token inputs:sourceColorSpace = "raw"')
    assert read(raw, color_space="lin_ap1_scene").textures[0].linear()[0, 0, 1] == 0


def test_alpha_is_straight_and_never_decoded(read, image):
    image(solid(200, 100, 50, 128))
    pixel = read(body()).textures[0].linear()[0, 0]
    assert pixel[3] == pytest.approx(128 / 255, rel=1e-3)
    assert pixel[0] == pytest.approx(((200 / 255 + 0.055) / 1.055) ** 2.4, rel=1e-3)


def test_row_0_is_the_top_of_the_image(read, image):
    pixels = np.zeros((4, 2, 3), np.uint8)
    pixels[0] = 255
    image(pixels)
    found = read(body()).textures[0].linear()
    assert (found[0] == 1).all()
    assert (found[1:] == 0).all()


def test_images_with_a_data_window_fill_their_display_window(tmp_path, read):
    spec = oiio.ImageSpec(2, 1, 3, "half")
    spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height = 1, 2, 0, 0, 4, 3
    output = oiio.ImageOutput.create(str(tmp_path / "crop.exr"))
    assert output.open(str(tmp_path / "crop.exr"), spec)
    assert output.write_image(np.ones((1, 2, 3), np.float16))
    output.close()
    found = read(body("crop.exr")).textures[0].linear()[..., 0]
    assert found.tolist() == [[0, 0, 0, 0], [0, 0, 0, 0], [0, 1, 1, 0]]


def test_values_that_are_no_numbers_are_brought_into_range(read, image):
    image(solid(np.inf, -np.inf, np.nan, dtype=np.float32), "huge.exr")
    assert read(body("huge.exr")).textures[0].linear()[0, 0].tolist() == [65504, -65504, 0]


def test_a_file_is_kept_once_whatever_it_is_read_as(read, image):
    image(solid(128, 128, 128))
    nodes = """
    def Shader "t2" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @image.png@
        token inputs:sourceColorSpace = "raw"
        token inputs:wrapS = "mirror"
        float2 inputs:st.connect = </M/st.outputs:result>
        float outputs:g
    }"""
    feeds = DIFFUSE + "\nfloat inputs:roughness.connect = </M/t2.outputs:g>"
    first, second = read(body(feeds=feeds, nodes=nodes)).textures
    assert first.pixels is second.pixels
    assert first.pixels.dtype == np.uint8
    assert first.linear()[0, 0, 1] == pytest.approx(SRGB_HALF, rel=1e-3)
    assert second.linear()[0, 0, 1] == pytest.approx(128 / 255, rel=1e-6)


@pytest.mark.parametrize(
    ("texture", "expected"),
    [
        ("", ("black", "black")),  # useMetadata, and the file has none
        ('token inputs:wrapS = "repeat"\ntoken inputs:wrapT = "mirror"', ("repeat", "mirror")),
        ('token inputs:wrapS = "clamp"\ntoken inputs:wrapT = "black"', ("clamp", "black")),
        ('token inputs:wrapS = "useMetadata"', ("black", "black")),
    ],
)
def test_wrap_modes(read, image, texture, expected):
    image(solid(1, 2, 3))
    found = read(body(texture=texture)).textures[0]
    assert (found.wrap_s, found.wrap_t) == expected


def test_wrap_modes_of_the_files_metadata(read, image):
    image(solid(0.5, 0.5, 0.5, dtype=np.float16), "wrap.exr", wrapmodes="periodic,clamp")
    found = read(body("wrap.exr")).textures[0]
    assert (found.wrap_s, found.wrap_t) == ("repeat", "clamp")
    declared = body("wrap.exr", 'token inputs:wrapS = "mirror"')
    assert read(declared).textures[0].wrap_s == "mirror"


def test_scale_bias_and_channel(read, image):
    image(solid(1, 2, 3))
    texture = """
        float4 inputs:scale = (2, 3, 4, 5)
        float4 inputs:bias = (0.1, 0.2, 0.3, 0.4)
    """
    feeds = DIFFUSE + "\nfloat inputs:roughness.connect = </M/t.outputs:g>"
    closure = read(body(texture=texture, feeds=feeds)).materials[0].closure
    for value, channel in ((closure.diffuseColor, "rgb"), (closure.roughness, "g")):
        assert value.channel == channel
        assert value.scale == (2, 3, 4, 5)
        assert value.bias == pytest.approx((0.1, 0.2, 0.3, 0.4))
        assert value.primvar == "st"


FLOAT_INPUTS = ("metallic", "roughness", "clearcoat", "clearcoatRoughness", "opacity", "ior")
COLOR_INPUTS = ("diffuseColor", "emissiveColor", "specularColor")


@pytest.mark.parametrize("mode", ["transparent", "presence", "threshold"])
@pytest.mark.parametrize("name", FLOAT_INPUTS + COLOR_INPUTS)
def test_every_input_may_be_textured_and_means_the_same_as_a_constant(read, image, name, mode):
    """A texture of 0.5 and the number 0.5; specularColor in its own workflow."""
    image(solid(0.5, 0.5, 0.5, dtype=np.float32), "half.exr")
    kind, constant, output = (
        ("float", "0.5", "r") if name in FLOAT_INPUTS else ("color3f", "(0.5, 0.5, 0.5)", "rgb")
    )
    others = "float inputs:clearcoat = 0.25\n" if "Roughness" in name else ""
    others += "int inputs:useSpecularWorkflow = 1\n" if name == "specularColor" else ""
    others += 'token inputs:opacityMode = "presence"\n' if mode == "presence" else ""
    others += "float inputs:opacityThreshold = 0.5\n" if mode == "threshold" else ""
    found = []
    for feeds in (
        f"{kind} inputs:{name} = {constant}",
        f"{kind} inputs:{name}.connect = </M/t.outputs:{output}>",
    ):
        scene = read(body("half.exr", feeds=others + feeds))
        st = {"st": np.full((3, 2), 0.5)}
        found.append(probe_material(scene.materials[0], scene.textures, st))
    constant_probe, textured = found
    assert constant_probe.lobes == textured.lobes
    assert constant_probe.emission == textured.emission
    assert (
        constant_probe.opacity
        == textured.opacity
        == (0.5 if name == "opacity" and mode == "presence" else 1.0)
    )


def test_materialxs_preview_surface_counts_its_opacity_modes(read):
    material = """
    def Material "M" {
        token outputs:mtlx:surface.connect = </M/s.outputs:out>
        def Shader "s" {
            uniform token info:id = "ND_UsdPreviewSurface_surfaceshader"
            float inputs:opacity = 0.25
            int inputs:opacityMode = MODE
            token outputs:out } }
    def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }
    """
    transparent, presence = (read(material.replace("MODE", m)).materials[0] for m in "01")
    assert (transparent.opacity, transparent.closure.opacity) == (1.0, 0.25)
    assert (presence.opacity, presence.closure.opacity) == (0.25, 1.0)


def test_where_the_mesh_lacks_the_primvar_the_readers_fallback_is_looked_up(read, image):
    pixels = np.zeros((1, 2, 3), np.float32)
    pixels[0, 1] = 0.75
    image(pixels, "halves.exr")
    text = body("halves.exr", 'token inputs:wrapS = "clamp"').replace(
        'string inputs:varname = "st"',
        'string inputs:varname = "none"\nfloat2 inputs:fallback = (1, 0.5)',
    )
    scene = read(text)
    lobes = probe_material(scene.materials[0], scene.textures).lobes
    assert next(x["weight"] for x in lobes if x["type"] == "diffuse") == pytest.approx([0.75] * 3)


def test_one_file_is_decoded_once_and_listed_once(read, image):
    image(solid(1, 2, 3))
    feeds = DIFFUSE + "\ncolor3f inputs:emissiveColor.connect = </M/t.outputs:rgb>"
    scene = read(body(feeds=feeds))
    assert len(scene.textures) == 1
    closure = scene.materials[0].closure
    assert closure.diffuseColor.texture == closure.emissiveColor.texture == 0


# ---------------------------------------------------------------------------------------------
# Texture coordinates


def sampled(value, st):
    return value.transform @ (*st, 1)


TRANSFORM = """
    def Shader "x" {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </M/IN>
        float inputs:rotation = 90
        float2 inputs:scale = (2, 3)
        float2 inputs:translation = (10, 20)
        float2 outputs:result
    }
"""


def test_transforms_scale_then_rotate_counter_clockwise_then_translate(read, image):
    image(solid(1, 2, 3))
    text = body(nodes=TRANSFORM.replace("IN", "st.outputs:result"), st="x.outputs:result")
    value = read(text).materials[0].closure.diffuseColor
    # (1, 0) → (2, 0) → (0, 2) → (10, 22);  (0, 1) → (0, 3) → (-3, 0) → (7, 20)
    assert sampled(value, (1, 0)) == pytest.approx([10, 22])
    assert sampled(value, (0, 1)) == pytest.approx([7, 20])


def test_chained_transforms_apply_from_the_reader_on(read, image):
    image(solid(1, 2, 3))
    second = """
        def Shader "y" {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </M/x.outputs:result>
            float2 inputs:scale = (10, 1)
            float2 outputs:result
        }
    """
    nodes = TRANSFORM.replace("IN", "st.outputs:result") + second
    value = read(body(nodes=nodes, st="y.outputs:result")).materials[0].closure.diffuseColor
    assert sampled(value, (1, 0)) == pytest.approx([100, 22])


def test_the_reader_may_name_another_primvar_as_string_or_token(read, image):
    image(solid(1, 2, 3))
    for declaration in ('string inputs:varname = "map1"', 'token inputs:varname = "map1"'):
        text = body().replace('string inputs:varname = "st"', declaration)
        text = text.replace("primvars:st", "primvars:map1")
        scene = read(text)
        assert scene.materials[0].closure.diffuseColor.primvar == "map1"
        assert scene.meshes[0].primvars["map1"].values.shape == (4, 2)


def test_an_unconnected_st_is_one_point_of_the_texture(read, image):
    image(solid(1, 2, 3))
    text = body().replace("float2 inputs:st.connect = </M/st.outputs:result>", "STVALUE")
    fixed = text.replace("STVALUE", "float2 inputs:st = (0.25, 0.75)")
    for body_text, point in ((fixed, (0.25, 0.75)), (text.replace("STVALUE", ""), (0, 0))):
        value = read(body_text).materials[0].closure.diffuseColor
        assert sampled(value, (9, 9)) == pytest.approx(point)


# ---------------------------------------------------------------------------------------------
# Interfaces, packages, and what is missing


def test_inputs_are_read_through_interfaces_and_nested_node_graphs(read, image):
    image(solid(1, 2, 3), "inner.png")
    scene = read("""
        def Material "M" {
            asset inputs:file = @inner.png@
            string inputs:uv = "map1"
            float inputs:shine = 0.75
            token outputs:surface.connect = </M/s.outputs:surface>
            def Shader "s" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </M/outer.outputs:color>
                float inputs:roughness.connect = </M.inputs:shine>
                token outputs:surface
            }
            def NodeGraph "outer" {
                asset inputs:file.connect = </M.inputs:file>
                color3f outputs:color.connect = </M/outer/inner.outputs:color>
                def NodeGraph "inner" {
                    asset inputs:file.connect = </M/outer.inputs:file>
                    color3f outputs:color.connect = </M/outer/inner/t.outputs:rgb>
                    def Shader "t" {
                        uniform token info:id = "UsdUVTexture"
                        asset inputs:file.connect = </M/outer/inner.inputs:file>
                        float2 inputs:st.connect = </M/outer/inner/uv.outputs:result>
                        float3 outputs:rgb
                    }
                    def Shader "uv" {
                        uniform token info:id = "UsdPrimvarReader_float2"
                        string inputs:varname.connect = </M.inputs:uv>
                        float2 outputs:result
                    }
                }
            }
        }
        def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            rel material:binding = </M> }""")
    closure = scene.materials[0].closure
    assert closure.roughness == 0.75
    assert closure.diffuseColor.primvar == "map1"
    assert scene.textures[0].name.endswith("inner.png")


def test_textures_inside_packages_are_read(write, image, tmp_path):
    image(solid(255, 0, 0), "red.png")
    package = tmp_path / "package.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(write(body("red.png"))), str(package))
    (tmp_path / "red.png").unlink()
    (tmp_path / "stage.usda").unlink()
    found = load(package).textures[0]
    assert found.linear()[0, 0].tolist() == [1, 0, 0]
    assert found.name.endswith("red.png]")


FALLBACK = "float4 inputs:fallback = (0.1, 0.2, 0.3, 0.4)"


@pytest.mark.parametrize(
    ("feeds", "name", "expected"),
    [
        (DIFFUSE, "diffuseColor", (0.1, 0.2, 0.3)),
        ("float inputs:roughness.connect = </M/t.outputs:g>", "roughness", 0.2),
        ("float inputs:opacity.connect = </M/t.outputs:a>", "opacity", 0.4),
    ],
)
def test_missing_textures_give_their_fallback_with_a_warning(write, feeds, name, expected):
    path = write(body("gone.png", FALLBACK, feeds))
    value = getattr(load(path).materials[0].closure, name)
    assert value == pytest.approx(expected)
    warning = next(w for w in inspect(path).warnings if "missing" in w.kind)
    assert warning.paths == ["/M/t.inputs:file (gone.png)"]


@pytest.mark.parametrize("content", [b"", b"not an image", b"\x89PNG\r\n\x1a\n"])
def test_unreadable_textures_give_their_fallback_with_a_warning(write, tmp_path, content):
    (tmp_path / "broken.png").write_bytes(content)
    path = write(body("broken.png", FALLBACK))
    assert load(path).materials[0].closure.diffuseColor == pytest.approx((0.1, 0.2, 0.3))
    warning = next(w for w in inspect(path).warnings if "cannot be read" in w.kind)
    assert "/M/t.inputs:file" in warning.paths[0]


def test_missing_textures_are_an_error_when_strict(read):
    with pytest.raises(Error, match=r"/M/t\.inputs:file \(gone\.png\): texture files are missing"):
        read(body("gone.png"), strict=True)


def test_the_tiles_of_a_udim_set_are_read_where_the_coordinates_are(read, image):
    image(solid(255, 0, 0), "tile.1002.png")
    image(solid(0, 255, 0), "tile.1001.png")
    image(solid(0, 0, 255), "tile.1011.png")
    scene = read(body("tile.<UDIM>.png"))
    material = scene.materials[0]
    assert sorted(material.closure.diffuseColor.texture) == [1001, 1002, 1011]
    for st, expected in (
        ((0.5, 0.5), (0, 1, 0)),
        ((0.999, 0.5), (0, 1, 0)),  # not filtered across the edge
        ((1.001, 0.5), (1, 0, 0)),
        ((0.5, 1.5), (0, 0, 1)),
        ((1.5, 1.5), (0, 0, 0)),  # there is no such tile
        ((-0.5, 0.5), (0, 0, 0)),
    ):
        lobes = probe_material(material, scene.textures, {"st": np.tile(st, (3, 1))}).lobes
        weights = [x["weight"] for x in lobes if x["type"] == "diffuse"] or [(0, 0, 0)]
        assert weights[0] == pytest.approx(expected, abs=1e-6), st


def test_a_udim_set_without_tiles_is_a_missing_texture(read, examine):
    assert read(body("none.<UDIM>.png")).textures == []
    assert any("missing" in w.kind for w in examine(body("none.<UDIM>.png")).warnings)


# ---------------------------------------------------------------------------------------------
# Light textures


def test_dome_textures_are_linear_floats(read, image):
    image(solid(2, 70000, 0.5, dtype=np.float32), "sky.exr")
    scene = read('def DomeLight "l" { asset inputs:texture:file = @sky.exr@ }')
    texture = scene.textures[scene.lights[0].texture]
    assert texture.pixels.dtype == np.float32
    assert texture.pixels[0, 0].tolist() == [2, 70000, 0.5]


def test_rect_textures_of_8_bits_are_srgb(read, image):
    image(solid(128, 128, 128), "panel.png")
    scene = read('def RectLight "l" { asset inputs:texture:file = @panel.png@ }')
    assert scene.textures[0].linear()[0, 0, 0] == pytest.approx(SRGB_HALF, rel=1e-4)


def test_a_light_whose_texture_is_missing_is_plain(read, examine):
    body_text = 'def DomeLight "l" { asset inputs:texture:file = @gone.exr@ }'
    assert read(body_text).lights[0].texture is None
    assert any("missing" in w.kind for w in examine(body_text).warnings)
