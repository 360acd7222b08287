"""What is visited: visibility, purpose, activation, and transforms."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from usdmlt.stage import load


def names(scene):
    return [mesh.name for mesh in scene.meshes]


def test_invisible_prims_hide_everything_below(read):
    scene = read("""
        def Xform "hidden" { token visibility = "invisible"
            def Cube "a" { token visibility = "inherited" } }
        def Cube "seen" {}""")
    assert names(scene) == ["/seen"]


def test_visibility_may_be_animated(read):
    body = """def Cube "c" {
        token visibility.timeSamples = { 1: "inherited", 2: "invisible" } }
    def Cube "d" {}"""
    assert names(read(body, frame=1)) == ["/c", "/d"]
    assert names(read(body, frame=2)) == ["/d"]


def test_inactive_and_abstract_prims_are_left_out(read):
    scene = read("""
        def Cube "off" (active = false) {}
        class Cube "abstract" {}
        over "undefined" { def Cube "c" {} }
        def Cube "on" {}""")
    assert names(scene) == ["/on"]


PURPOSES = """
    def Xform "x" {
        def Cube "plain" {}
        def Xform "r" { uniform token purpose = "render"
            def Cube "c" {}
            def Cube "g" { uniform token purpose = "guide" } }
        def Cube "p" { uniform token purpose = "proxy" }
    }
"""


@pytest.mark.parametrize(
    ("purposes", "expected"),
    [
        (None, ["/x/plain", "/x/r/c"]),
        (("default",), ["/x/plain"]),
        (("proxy",), ["/x/plain", "/x/p"]),
        (("render", "guide"), ["/x/plain", "/x/r/c", "/x/r/g"]),
    ],
)
def test_purposes_are_inherited_and_chosen(read, purposes, expected):
    assert names(read(PURPOSES, purposes=purposes)) == expected


def test_render_settings_choose_purposes_unless_asked(read):
    body = f"""{PURPOSES}
        def RenderSettings "settings" {{ token[] includedPurposes = ["proxy"] }}"""
    assert names(read(body)) == ["/x/plain", "/x/p"]
    assert names(read(body, purposes=["render"])) == ["/x/plain", "/x/r/c"]


PURPOSE_VISIBILITY = """
    def Xform "x" (prepend apiSchemas = ["VisibilityAPI"]) {
        uniform token renderVisibility = "invisible"
        def Cube "plain" {}
        def Xform "r" { uniform token purpose = "render"
            def Cube "a" {}
            def Cube "b" (prepend apiSchemas = ["VisibilityAPI"]) {
                uniform token renderVisibility = "visible" }
            def Cube "c" (prepend apiSchemas = ["VisibilityAPI"]) {
                uniform token renderVisibility = "inherited" }
            def Xform "i" (
                instanceable = true
                references = </Class>
            ) {} }
        def Cube "p" { uniform token purpose = "proxy" }
    }
    class "Class" { def Cube "c" {} }
    def Cube "r" (prepend apiSchemas = ["VisibilityAPI"]) {
        uniform token purpose = "render"
        uniform token proxyVisibility = "invisible" }
    def Cube "g" { uniform token purpose = "guide" }
    def Cube "h" (prepend apiSchemas = ["VisibilityAPI"]) {
        uniform token purpose = "guide"
        uniform token guideVisibility = "invisible" }
"""


def test_purposes_have_a_visibility_of_their_own(read):
    found = names(read(PURPOSE_VISIBILITY, purposes=["render", "proxy", "guide"]))
    assert found == ["/x/plain", "/x/r/b", "/x/r/c", "/x/p", "/r", "/g"]


def test_the_visibility_of_purposes_is_the_one_that_usd_computes(write):
    stage = Usd.Stage.Open(str(write(PURPOSE_VISIBILITY)))
    for purpose in ("render", "proxy"):
        expected = [
            str(prim.GetPath())
            for prim in stage.Traverse()
            if prim.IsA(UsdGeom.Cube)
            and UsdGeom.Imageable(prim).ComputePurpose() == purpose
            and UsdGeom.Imageable(prim).ComputeEffectiveVisibility(purpose) != "invisible"
        ]
        found = names(load(stage, purposes=[purpose]))
        assert [name for name in found if name != "/x/plain"] == expected


def test_an_unknown_purpose_is_a_wrong_value(read):
    with pytest.raises(ValueError, match="unknown purposes: final"):
        read('def Cube "c" {}', purposes=["final"])


NESTED = """
def Xform "a" {
    double3 xformOp:translate = (1, 2, 3)
    float3 xformOp:rotateXYZ = (10, 20, 30)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    def "typeless" {
        def Xform "b" {
            float3 xformOp:scale = (2, -3, 0.5)
            uniform token[] xformOpOrder = ["xformOp:scale"]
            def Cube "c" {
                double3 xformOp:translate:pivot = (5, 0, 0)
                float xformOp:rotateZ = 45
                uniform token[] xformOpOrder = [
                    "xformOp:translate:pivot", "xformOp:rotateZ", "!invert!xformOp:translate:pivot"]
            }
            def Cube "reset" {
                double3 xformOp:translate = (7, 8, 9)
                uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
            }
        }
    }
}
"""


def test_transforms_are_those_that_usd_composes(write):
    stage = Usd.Stage.Open(str(write(NESTED)))
    cache = UsdGeom.XformCache()
    meshes = load(stage).meshes
    assert len(meshes) == 2
    for mesh in meshes:
        expected = np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(mesh.name)))
        assert mesh.transform == pytest.approx(expected, abs=1e-12)


def test_meshes_below_meshes_are_found(read):
    assert names(read('def Cube "outer" { def Cube "inner" {} }')) == ["/outer", "/outer/inner"]


@pytest.mark.parametrize("kind", ["FluffyCloud", "ParticleField3DGaussianSplat"])
def test_unsupported_shapes_are_named_once_and_the_rest_is_read(examine, kind):
    found = examine(f'def {kind} "a" {{}}\ndef {kind} "b" {{}}\ndef Cube "c" {{}}')
    assert found.meshes == 1
    assert [w.paths for w in found.warnings if kind in w.kind] == [["/a", "/b"]]


def test_unsupported_shapes_that_are_not_shown_are_not_mentioned(examine):
    found = examine("""
        def PortalLight "a" { token visibility = "invisible" }
        def PortalLight "b" { uniform token purpose = "guide" }
        def Cube "c" {}""")
    assert not any("PortalLight" in w.kind for w in found.warnings)


def test_a_type_no_schema_knows_is_named(examine):
    found = examine('def FluffyCloud "a" {}\ndef Cube "c" {}')
    assert [w.paths for w in found.warnings if "FluffyCloud" in w.kind] == [["/a"]]
