""".mtlx files that stages refer to: layout, nodes, composition, instances, and what is missing."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pxr import Usd, UsdShade

from support.scattering import probe_material, random_directions
from usdmlt.errors import Error, Report
from usdmlt.scene import Diffuse, Node, PrimvarInput, TextureInput
from usdmlt.stage import inspect, load
from usdmlt.stage.color import decode
from usdmlt.stage.mtlx_files import with_mtlx_files
from usdmlt.stage.opening import open_stage

pytest.importorskip("MaterialX", reason="the extra `materialx` is not installed")

ASSETS = os.environ.get("USDMLT_ASSETS")
DOCUMENT = """<?xml version="1.0"?>
<materialx version="1.39" colorspace="lin_rec709">
  NODES
  <standard_surface name="surface" type="surfaceshader">
    <input name="specular" type="float" value="0" />
    INPUTS
  </standard_surface>
  <surfacematerial name="Red" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="surface" />
  </surfacematerial>
</materialx>
"""
RED = '<input name="base_color" type="color3" value="0.8, 0.1, 0.1" />'
STAGE = """
def Scope "looks" ( references = @m.mtlx@</MaterialX> ) { }
def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"])
{ rel material:binding = </looks/Materials/Red> }
"""


@pytest.fixture
def document(tmp_path):
    """Write a MaterialX document beside the stage."""

    def write_document(inputs: str = RED, nodes: str = "", name: str = "m.mtlx") -> Path:
        path = tmp_path / name
        path.write_text(DOCUMENT.replace("INPUTS", inputs).replace("NODES", nodes))
        return path

    return write_document


RED_DIFFUSE = Diffuse(pytest.approx((0.8, 0.1, 0.1)), 1.0, 0.0)


@pytest.mark.parametrize(
    ("target", "bound"),
    [
        ("</MaterialX>", "/looks/Materials/Red"),
        ("", "/looks/Materials/Red"),  # the default prim
        ("</MaterialX/Materials>", "/looks/Red"),
        ("</MaterialX/Materials/Red>", "/looks"),
    ],
)
def test_references_are_bound_as_if_they_had_composed(read, document, target, bound):
    document()
    body = STAGE.replace("</MaterialX>", target).replace("/looks/Materials/Red", bound)
    if bound == "/looks":
        body = body.replace('def Scope "looks"', 'def "looks"')
    assert read(body).materials[0].closure == RED_DIFFUSE


def test_references_inside_variants_and_referenced_files_are_followed(read, document, tmp_path):
    document()
    document(RED.replace("0.8, 0.1", "0.2, 0.9"), name="green.mtlx")
    (tmp_path / "asset.usda").write_text(
        """#usda 1.0
        def Scope "asset" (
            variants = {
                string look = "red"
            }
            prepend variantSets = "look"
        ) {
            variantSet "look" = {
                "red" {
                    over "m" ( references = @m.mtlx@</MaterialX/Materials> ) {
                    }
                }
                "green" {
                    over "m" ( references = @green.mtlx@</MaterialX/Materials> ) {
                    }
                }
            }
            def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"])
            { rel material:binding = </asset/m/Red>
            }
        }
        """
    )
    body = 'def "a" ( references = @asset.usda@</asset>\nVARIANT ) { }'
    assert read(body.replace("VARIANT", "")).materials[0].closure == RED_DIFFUSE
    green = read(body.replace("VARIANT", 'variants = { string look = "green" }'))
    assert green.materials[0].closure.color == pytest.approx((0.2, 0.9, 0.1))


def test_instances_whose_materials_are_mtlx_files_are_rendered(read, document, tmp_path):
    document()
    (tmp_path / "asset.usda").write_text(
        """#usda 1.0
        def Xform "asset" {
            def Scope "m" ( references = @m.mtlx@</MaterialX/Materials> ) {
            }
            def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"])
            { rel material:binding = </asset/m/Red>
            }
        }
        """
    )
    instance = 'def "NAME" ( references = @asset.usda@</asset>\ninstanceable = true ) { }\n'
    scene = read(instance.replace("NAME", "a") + instance.replace("NAME", "b"))
    assert len(scene.meshes) == 2
    assert all(material.closure == RED_DIFFUSE for material in scene.materials)


def test_a_stage_that_is_passed_in_is_left_as_it_is(write, document):
    document()
    stage = Usd.Stage.Open(str(write(STAGE)))
    before = stage.GetSessionLayer().ExportToString(), stage.GetRootLayer().ExportToString()
    assert load(stage).materials[0].closure == RED_DIFFUSE
    after = stage.GetSessionLayer().ExportToString(), stage.GetRootLayer().ExportToString()
    assert before == after
    assert not stage.GetPrimAtPath("/looks/Materials/Red")


def test_opinions_over_the_reference_are_stronger(read, document):
    document()
    over = """{
        over "Materials" { over "Red" { over "surface" {
            color3f inputs:base_color = (0.1, 0.2, 0.9) } } }
    }"""
    assert read(STAGE.replace(") { }", f") {over}", 1)).materials[0].closure.color == pytest.approx(
        (0.1, 0.2, 0.9)
    )


def test_node_graphs_their_interfaces_and_outputs_are_resolved(read, document):
    nodes = """
  <nodegraph name="graph">
    <input name="scale" type="float" value="0.5" />
    <input name="tint" type="color3" value="0.2, 0.4, 0.6" />
    <geompropvalue name="color" type="color3">
      <input name="geomprop" type="string" value="displayColor" />
    </geompropvalue>
    <multiply name="scaled" type="color3">
      <input name="in1" type="color3" nodename="color" />
      <input name="in2" type="float" interfacename="scale" />
    </multiply>
    <separate3 name="parts" type="multioutput">
      <input name="in" type="color3" interfacename="tint" />
    </separate3>
    <output name="a" type="color3" nodename="scaled" />
    <output name="b" type="float" nodename="parts" output="outg" />
  </nodegraph>"""
    document(
        '<input name="base_color" type="color3" nodegraph="graph" output="a" />'
        '<input name="base" type="float" nodegraph="graph" output="b" />',
        nodes,
    )
    closure = read(STAGE).materials[0].closure
    assert isinstance(closure.color, Node) and closure.color.operation == "multiply"
    assert closure.color.inputs == (PrimvarInput("displayColor", (0.0, 0.0, 0.0)), 0.5)
    assert closure.weight == pytest.approx(0.4)


def test_nodes_that_materialx_makes_of_others_are_rendered(read, document):
    """colorcorrect has no entry of its own: the library's graph of it is followed."""
    nodes = """
  <colorcorrect name="corrected" type="color3">
    <input name="in" type="color3" value="0.2, 0.4, 0.6" />
    <input name="gain" type="float" value="0.5" />
    <input name="exposure" type="float" value="1" />
    <input name="lift" type="float" value="0" />
  </colorcorrect>"""
    document('<input name="base_color" type="color3" nodename="corrected" />', nodes)
    scene = read(STAGE)
    lobes = probe_material(scene.materials[0]).lobes
    assert lobes[0]["weight"] == pytest.approx((0.2, 0.4, 0.6), rel=1e-4)


def test_files_are_found_with_the_documents_prefix_and_folder(read, document, tmp_path):
    import OpenImageIO as oiio

    (tmp_path / "maps").mkdir()
    spec = oiio.ImageSpec(2, 2, 3, "uint8")
    output = oiio.ImageOutput.create(str(tmp_path / "maps" / "a.png"))
    output.open(str(tmp_path / "maps" / "a.png"), spec)
    output.write_image(np.full((2, 2, 3), 128, np.uint8))
    output.close()
    image = """<image name="image" type="color3" fileprefix="maps/">
        <input name="file" type="filename" value="a.png" colorspace="srgb_texture" /></image>"""
    document('<input name="base_color" type="color3" nodename="image" />', image)
    scene = read(STAGE)
    assert isinstance(scene.materials[0].closure.color, TextureInput)
    assert scene.textures[0].linear()[0, 0, 0] == pytest.approx(0.21586, rel=1e-3)


def test_without_the_package_one_line_says_how_to_get_it(write, document, monkeypatch):
    document()
    path = write(STAGE)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    warnings = [str(w) for w in inspect(path).warnings if "MaterialX" in w.kind]
    assert len(warnings) == 1
    assert "pip install 'usdmlt[materialx]'" in warnings[0]
    assert "m.mtlx" in warnings[0]
    with pytest.raises(Error, match="materialx"):
        load(path, strict=True)


@pytest.mark.parametrize("text", ["", "<materialx", "not xml"])
def test_broken_documents_are_warned_of(write, tmp_path, text):
    (tmp_path / "m.mtlx").write_text(text)
    warnings = [str(w) for w in inspect(write(STAGE)).warnings]
    assert any("m.mtlx" in w for w in warnings) or any("missing" in w for w in warnings)


def test_missing_documents_are_warned_of_once(write):
    warnings = [str(w) for w in inspect(write(STAGE)).warnings]
    assert sum("m.mtlx" in w for w in warnings) == 1


def test_other_stages_are_not_opened_twice(write):
    stage = open_stage(write('def Cube "c" { }'))
    assert with_mtlx_files(stage, Report()) is stage


# ---------------------------------------------------------------------------------------------
# Real files

assets = pytest.mark.skipif(not ASSETS, reason="USDMLT_ASSETS names no folder of real files")
TESTS = Path(ASSETS or "") / "usd-wg" / "test_assets"
BALL = Path(ASSETS or "") / "usd-wg" / "full_assets" / "StandardShaderBall"


def lobes_at(scene, material, st=(0.3, 0.6)):
    names = {name for mesh in scene.meshes for name in mesh.primvars} | {"st"}
    primvars = {name: np.tile(st, (3, 1)) for name in names}
    return probe_material(material, scene.textures, primvars).lobes


def diffuse_at(scene, material, st) -> np.ndarray:
    """The diffuse colour; a black lobe is left out of a closure."""
    found = [x["weight"] for x in lobes_at(scene, material, st) if x["type"] == "diffuse"]
    return np.array(found[0] if found else (0.0, 0.0, 0.0))


@assets
@pytest.mark.parametrize("name", ["basic", "basicTextured"])
def test_references_and_their_flattened_copies_agree(name):
    """OpenUSD's own plugin wrote the flattened files."""
    folder = TESTS / "MaterialXTest"
    referenced, flattened = (load(folder / f"{name}{end}.usda") for end in ("", "_flatten"))
    material = {m.name: m for m in flattened.materials}
    assert referenced.materials
    for ours in referenced.materials:
        theirs = material[ours.name]
        assert type(ours.closure) is type(theirs.closure)
        assert lobes_at(referenced, ours) == lobes_at(flattened, theirs)


@assets
def test_texture_coordinates_agree_with_the_usd_version():
    usd, mtlx = (
        load(TESTS / "TextureCoordinateTest" / f"TextureCoordinateTest{end}.usda")
        for end in ("", "MaterialX")
    )
    by_name = {os.path.basename(m.name): m for m in usd.materials}
    corners = [m for m in mtlx.materials if os.path.basename(m.name) in by_name]
    assert len(corners) == 5
    seen = []
    height, width = usd.textures[0].pixels.shape[:2]
    texels = np.random.default_rng(4).integers(0, (width, height), (40, 2))
    centres = (texels + 0.5) / (width, height)  # elsewhere filtering is before or after decoding
    for theirs in corners:
        ours = by_name[os.path.basename(theirs.name)]
        for st in centres:
            a, b = diffuse_at(usd, ours, st), diffuse_at(mtlx, theirs, st)
            # The document says that the picture is linear, the USD version that it is sRGB, with
            # a colour for each corner.
            if "BackPlane" in theirs.name:
                assert a == pytest.approx(b)
                continue
            color = ours.closure.diffuseColor.scale[:3]
            expected = decode(b, "srgb_rec709_scene") * color
            assert_allclose(a, expected, atol=5e-3)
            seen.append(b)
    assert np.ptp(seen, axis=0).max() > 0.2  # not white only


def shader_ball(material: str, model: str):
    """The material of the ball for a choice of the stage's variants."""
    stage = Usd.Stage.Open(str(BALL / "standard_shader_ball_scene.usda"))
    root = stage.GetDefaultPrim()
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        root.GetVariantSets().SetSelection("example_material", material)
        examples = stage.GetPrimAtPath(root.GetPath().AppendPath("materials/examples"))
        examples.GetVariantSets().SetSelection("material_model", model)
    scene = load(stage, width=8, height=8)
    wanted = material.removeprefix("mtlx_")
    return next(m for m in scene.materials if m.name.endswith(f"examples/mtlx/{wanted}"))


@assets
@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("plastic", 1e-4),
        ("glass", 1e-4),
        ("gold", 0.06),  # of the reflectance at all angles: two curves of Fresnel's
        # A weight of the layer, or of its normal reflectance only: not the same at grazing angles.
        ("bubblegum", 0.1),
    ],
)
def test_the_shader_balls_two_models_agree(name, tolerance):
    standard, open_pbr = (
        probe_material(shader_ball(f"mtlx_{name}", model))
        for model in ("standard_surface", "OpenPBRSurface")
    )
    light, eye = random_directions(20_000, seed=1), random_directions(20_000, seed=2)
    light[:, 2], eye[:, 2] = np.abs(light[:, 2]), np.abs(eye[:, 2])
    for closure in (standard, open_pbr):
        assert closure.lobes
    a, b = (np.asarray(c.evaluate(light, eye), np.float64) for c in (standard, open_pbr))
    energy = (a * light[:, 2:]).mean(axis=0), (b * light[:, 2:]).mean(axis=0)
    assert_allclose(energy[0], energy[1], rtol=tolerance, atol=tolerance * 0.1)


def test_the_layout_is_that_of_openusds_plugin(write, document):
    document()
    stage = with_mtlx_files(open_stage(write(STAGE)), Report())
    material = UsdShade.Material(stage.GetPrimAtPath("/looks/Materials/Red"))
    shader = material.ComputeSurfaceSource("mtlx")[0]
    assert shader.GetIdAttr().Get() == "ND_standard_surface_surfaceshader"
