"""UsdRender settings, products, vars and passes, and our own attributes beside them."""

from __future__ import annotations

import pytest
from pxr import Usd

from usdmlt.errors import Error
from usdmlt.settings import MUTATIONS, Settings, merged
from usdmlt.stage import products
from usdmlt.stage.usdmlt_settings import FIELDS, LOAD_FIELDS, WORLD_MEDIUM

CAMERAS = """
def Camera "wide" {
    float focalLength = 10
    float horizontalAperture = 20
    float verticalAperture = 10
    float fStop = 2
    float focusDistance = 5
}
def Camera "tele" { float focalLength = 100 }
def Cube "box" {}
"""
RENDER = (
    CAMERAS
    + """
def Scope "Render" {
    def RenderSettings "first" {
        rel camera = </wide>
        uniform int2 resolution = (40, 20)
        MORE
        rel products = [</Render/beauty>, </Render/small>]
    }
    def RenderSettings "second" {
        uniform int2 resolution = (64, 64)
    }
    def RenderPass "pass" { rel renderSource = </Render/second> }
    def RenderProduct "beauty" {}
    def RenderProduct "small" {
        rel camera = </tele>
        uniform int2 resolution = (8, 4)
        token productName = "little.exr"
    }
}
"""
)


def body(more: str = "") -> str:
    return RENDER.replace("MORE", more)


def kinds(inspection) -> list[str]:
    return [w.kind for w in inspection.warnings if "no lights" not in w.kind]


def test_the_settings_asked_for_come_before_the_first(read):
    assert read(body()).width == 40
    assert read(body(), render_settings="/Render/second").width == 64
    assert read(body(), render_pass="/Render/pass").width == 64
    assert read(body(), 'renderSettingsPrimPath = "/Render/second"').width == 64


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"render_settings": "/wide"}, "/wide: no such RenderSettings; there are /Render/first, /"),
        ({"render_pass": "/none"}, "/none: no such RenderPass; there are /Render/pass"),
        ({"product": "/Render/none"}, "no raster product of /Render/first; there are /Render/be"),
    ],
)
def test_what_is_asked_for_and_not_there_is_an_error(read, options, says):
    with pytest.raises(Error, match=says):
        read(body(), **options)


def test_a_pass_without_settings_is_an_error(read):
    with pytest.raises(Error, match="its renderSource names no RenderSettings"):
        read(CAMERAS + 'def RenderPass "p" {}', render_pass="/p")


@pytest.mark.parametrize(
    ("purposes", "warned"),
    [
        ('["full", ""]', False),
        ('["full", "allPurpose"]', False),
        ('["preview"]', False),
        ('["preview", "full"]', True),
    ],
)
def test_of_several_material_purposes_the_first_counts(examine, purposes, warned):
    found = kinds(examine(body(f"uniform token[] materialBindingPurposes = {purposes}")))
    assert any("material purposes" in kind for kind in found) == warned


def test_a_product_has_stronger_opinions_than_its_settings(read):
    scene = read(body())
    assert (scene.camera.name, scene.width, scene.height) == ("/wide", 40, 20)
    scene = read(body(), product="/Render/small")
    assert (scene.camera.name, scene.width, scene.height) == ("/tele", 8, 4)


def test_products_are_named_and_unnamed_ones_after_their_prim(write):
    found = products(write(body()))
    assert [(p.path, p.name) for p in found] == [
        ("/Render/beauty", "beauty.exr"),
        ("/Render/small", "little.exr"),
    ]


def test_other_products_and_vars_are_one_warning_each(examine):
    more = "rel products = [</r/deep>, </r/p>]"
    text = f"""
def RenderSettings "r" {{
    {more}
    def RenderProduct "deep" {{ token productType = "deepRaster" }}
    def RenderProduct "p" {{ rel orderedVars = [</r/Ci>, </r/a>, </r/N>, </r/id>] }}
    def RenderVar "Ci" {{}}
    def RenderVar "a" {{ uniform string sourceName = "a" }}
    def RenderVar "N" {{ uniform string sourceName = "Nn" }}
    def RenderVar "id" {{}}
}}
{CAMERAS}"""
    warnings = {w.kind: w.paths for w in examine(text, render_settings="/r").warnings}
    assert warnings["products other than raster ones are not made"] == ["/r/deep (deepRaster)"]
    left_out = warnings["render vars that cannot be made are left out"]
    assert left_out == ["/r/id (there is no layer id)"]


def test_depth_of_field_is_disabled_by_the_settings(read):
    assert read(body()).camera.lens_radius == pytest.approx(0.1 * 10 / (2 * 2))
    assert read(body("uniform bool disableDepthOfField = 1")).camera.lens_radius == 0


@pytest.mark.parametrize(
    ("policy", "window"),
    [
        # The picture is 2:1 as the aperture is; with pixels twice as wide as high it is 4:1.
        ("expandAperture", (-2, 2, -0.5, 0.5)),
        ("cropAperture", (-1, 1, -0.25, 0.25)),
        ("adjustApertureWidth", (-2, 2, -0.5, 0.5)),
        ("adjustApertureHeight", (-1, 1, -0.25, 0.25)),
        ("adjustPixelAspectRatio", (-1, 1, -0.5, 0.5)),
    ],
)
def test_the_aperture_conforms_to_the_picture(read, policy, window):
    more = f'uniform token aspectRatioConformPolicy = "{policy}"\nuniform float pixelAspectRatio=2'
    assert read(body(more)).camera.window == pytest.approx(window)


def test_the_rendering_colour_space_is_the_settings_unless_asked_for(read):
    more = 'uniform token renderingColorSpace = "lin_ap1_scene"'
    assert read(body()).color_space == "lin_rec709_scene"
    assert read(body(more)).color_space == "lin_ap1_scene"
    assert read(body(more), color_space="lin_rec2020_scene").color_space == "lin_rec2020_scene"


def test_a_rendering_colour_space_that_cannot_be_is_a_warning(examine):
    more = 'uniform token renderingColorSpace = "srgb_rec709_scene"'
    assert any("renderingColorSpace counts as" in kind for kind in kinds(examine(body(more))))


def test_purposes_and_material_purposes(read):
    text = body('uniform token[] includedPurposes = ["guide"]')
    text += 'def Sphere "g" { uniform token purpose = "guide" }'
    text += '\ndef Sphere "r" { uniform token purpose = "render" }'
    assert {mesh.name for mesh in read(text).meshes} == {"/box", "/g"}
    assert {m.name for m in read(text, purposes="render").meshes} == {"/box", "/r"}
    with pytest.raises(Error, match="unknown purposes: gide"):
        read(body('uniform token[] includedPurposes = ["gide"]'))


# ---------------------------------------------------------------------------------------------
# usdmlt: attributes

OURS = """
    string usdmlt:integrator = "mlt"
    int usdmlt:mutations = 12
    int usdmlt:depth = 5
    int usdmlt:seed = 77
    bool usdmlt:twoStage = 0
    float usdmlt:mutationWeights:lens = 0.25
    float usdmlt:mutationWeights:new_path = 1
"""


def test_our_attributes_are_settings(read):
    assert read(body(OURS)).settings == {
        "integrator": "mlt",
        "mutations": 12,
        "depth": 5,
        "seed": 77,
        "two_stage": False,
        "mutation_weights": {"lens": 0.25, "new_path": 1.0},
    }
    assert read(body()).settings == {}


@pytest.mark.parametrize(
    ("attribute", "says"),
    [
        ("int usdmlt:depth = 0", "/Render/first: depth must be between 1 and"),
        ('string usdmlt:depth = "x"', "/Render/first: usdmlt:depth is 'x', which is no int"),
        ("float usdmlt:depth = 2.5", "usdmlt:depth is 2.5, which is no int"),
        ('token usdmlt:integrator = "mtl"', "integrator must be one of"),
        ("float usdmlt:mutationWeights:lens = 1", "add new_path or bidirectional"),
    ],
)
def test_values_that_cannot_be_are_an_error_with_the_prim(read, attribute, says):
    with pytest.raises(Error, match=says):
        read(body(attribute))


def test_unknown_names_of_ours_are_a_warning(examine):
    assert "unknown usdmlt: attributes are ignored" in kinds(examine(body("int usdmlt:dpeth = 3")))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, {"integrator": "mlt", "mutations": 12, "seed": 77}),
        ({"seed": 1}, {"integrator": "mlt", "mutations": 12, "seed": 1}),
        ({"samples": 3}, {"integrator": "mlt", "samples": 3, "mutations": None}),
        ({"integrator": "path"}, {"integrator": "path", "mutations": None, "seed": 77}),
    ],
)
def test_what_is_given_comes_before_what_the_stage_asks_for(given, expected):
    asked = {"integrator": "mlt", "mutations": 12, "seed": 77}
    settings = merged(asked, given)
    assert {name: getattr(settings, name) for name in expected} == expected


# ---------------------------------------------------------------------------------------------
# The codeless schema


def test_the_schema_declares_what_is_read(tmp_path):
    """A process that has it registered knows all the attributes, and none besides."""
    import importlib.resources
    import os
    import subprocess
    import sys

    folder = importlib.resources.files("usdmlt") / "schema"
    code = """
from pxr import Usd
definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("UsdmltRenderSettingsAPI")
print(*definition.GetPropertyNames())
stage = Usd.Stage.CreateInMemory()
prim = stage.DefinePrim("/s", "RenderSettings")
assert prim.ApplyAPI("UsdmltRenderSettingsAPI")
print(prim.GetAttribute("usdmlt:depth").Get(), prim.GetAttribute("usdmlt:integrator").Get())
assert not prim.GetAttribute("usdmlt:depth").HasAuthoredValue()
"""
    environment = {**os.environ, "PXR_PLUGINPATH_NAME": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    names, defaults = done.stdout.splitlines()
    weights = {f"usdmlt:mutationWeights:{name}" for name in MUTATIONS}
    expected = {f"usdmlt:{n}" for n in (*FIELDS, *LOAD_FIELDS)} | weights | {WORLD_MEDIUM}
    assert set(names.split()) == expected
    assert defaults == f"{Settings().depth} {Settings().integrator}"


def test_nothing_depends_on_the_schema(write):
    """Applied and not registered, it changes nothing."""
    text = body(OURS).replace(
        'def RenderSettings "first" {',
        'def RenderSettings "first" (prepend apiSchemas = ["UsdmltRenderSettingsAPI"]) {',
    )
    from usdmlt.stage import load

    assert load(Usd.Stage.Open(str(write(text)))).settings["depth"] == 5
