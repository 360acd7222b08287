"""Opening stages: formats, payloads, variants, masks, session layers, times."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdUtils

from usdmlt.errors import Error
from usdmlt.stage import load

MOVING = """
def Cube "c" {
    double3 xformOp:translate.timeSamples = { 1: (1, 0, 0), 11: (11, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


@pytest.mark.parametrize("extension", ["usd", "usda", "usdc"])
def test_each_file_format_gives_the_same_scene(write, tmp_path, extension):
    path = tmp_path / f"copy.{extension}"
    Sdf.Layer.FindOrOpen(str(write('def Cube "c" { double size = 3 }'))).Export(str(path))
    assert np.ptp(load(path).meshes[0].points, axis=0) == pytest.approx([3, 3, 3])


def test_a_package_is_read(write, tmp_path):
    path = tmp_path / "package.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(write('def Cube "c" {}')), str(path))
    assert len(load(path).meshes) == 1


def test_payloads_are_loaded(write):
    write('def Cube "c" {}', 'defaultPrim = "c"', name="payload.usda")
    assert len(load(write('def "p" (payload = @payload.usda@) {}')).meshes) == 1


def test_the_authored_variant_is_read(read):
    body = """
def Xform "x" (
    variants = { string size = "big" }
    prepend variantSets = "size"
) {
    variantSet "size" = {
        "big" { def Cube "c" { double size = 4 } }
        "small" { def Cube "c" { double size = 1 } }
    }
}
"""
    assert np.ptp(read(body).meshes[0].points, axis=0) == pytest.approx([4, 4, 4])


def test_a_mask_leaves_only_what_is_asked_for(read):
    body = 'def Xform "a" { def Cube "c" {} }\ndef Xform "b" { def Cube "c" {} }'
    assert [mesh.name for mesh in read(body, mask=["/b"]).meshes] == ["/b/c"]


def test_the_session_layer_has_the_strongest_opinion(write):
    session = write('over "c" { double size = 7 }', name="session.usda")
    scene = load(write('def Cube "c" { double size = 1 }'), session_layer=session)
    assert np.ptp(scene.meshes[0].points, axis=0) == pytest.approx([7, 7, 7])


def test_an_open_stage_is_read_with_its_unsaved_edits_and_left_alone(write):
    stage = Usd.Stage.Open(str(write('def Cube "c" {}')))
    UsdGeom.Cube.Get(stage, "/c").GetSizeAttr().Set(5.0)
    before = stage.ExportToString()
    assert np.ptp(load(stage).meshes[0].points, axis=0) == pytest.approx([5, 5, 5])
    assert stage.ExportToString() == before


def test_a_masked_open_stage_stays_unmasked(write):
    stage = Usd.Stage.Open(str(write('def Cube "a" {}\ndef Cube "b" {}')))
    assert len(load(stage, mask=["/a"]).meshes) == 1
    assert stage.GetPrimAtPath("/b")


def test_a_frame_between_samples_is_interpolated(read):
    assert read(MOVING, frame=6).meshes[0].transform[3, 0] == pytest.approx(6)


@pytest.mark.parametrize(("frame", "place"), [(-5, 1), (1, 1), (11, 11), (500, 11)])
def test_beyond_the_samples_the_outermost_hold(read, frame, place):
    assert read(MOVING, frame=frame).meshes[0].transform[3, 0] == place


@pytest.mark.parametrize("options", [{}, {"overrides": {"/c.size": "3"}}], ids=["as it is", "anew"])
def test_a_stage_that_holds_values_is_read_so(write, options):
    stage = Usd.Stage.Open(str(write(MOVING)))
    stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    assert load(stage, frame=6, **options).meshes[0].transform[3, 0] == 1


def test_what_is_set_on_an_open_stage_counts_when_it_is_opened_anew(write):
    muted = write('over "c" { double size = 7 }', name="muted.usda")
    write('def Cube "inside" {}', 'defaultPrim = "inside"', name="payload.usda")
    body = MOVING + 'def "p" (payload = @payload.usda@) {}\ndef Cube "masked" {}'
    mask = Usd.StagePopulationMask(["/c", "/p"])
    root = str(write(body, "subLayers = [@muted.usda@]"))
    stage = Usd.Stage.OpenMasked(root, mask, Usd.Stage.LoadNone)
    stage.MuteLayer(str(muted))
    for options in ({}, {"overrides": {"/c.visibility": "inherited"}}):
        scene = load(stage, **options)
        assert [mesh.name for mesh in scene.meshes] == ["/c"]
        assert np.ptp(scene.meshes[0].points, axis=0) == pytest.approx([2, 2, 2])


def test_without_a_frame_the_start_of_the_stage_is_read(read):
    scene = read(MOVING, "startTimeCode = 3\nendTimeCode = 11")
    assert scene.meshes[0].transform[3, 0] == pytest.approx(3)
    assert scene.metadata["frame"] == 3


def test_without_a_start_the_earliest_sample_is_read(read):
    scene = read(MOVING)
    assert scene.meshes[0].transform[3, 0] == pytest.approx(1)
    assert scene.metadata["frame"] is None


def test_a_frame_that_is_no_number_is_a_wrong_value(read):
    with pytest.raises(ValueError, match="frame must be a number"):
        read(MOVING, frame=float("nan"))


def test_metres_per_unit_never_scale_the_geometry(read):
    scene = read('def Cube "c" {}', "metersPerUnit = 0.01")
    assert np.ptp(scene.meshes[0].points, axis=0) == pytest.approx([2, 2, 2])
    assert np.array_equal(scene.meshes[0].transform, np.eye(4))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(Error, match=r"none\.usda: no such file"):
        load(tmp_path / "none.usda")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("text.usda", b"this is not USD\n"),
        ("open.usda", b'#usda 1.0\ndef Xform "a" {\n'),
        ("noise.usd", b"\x00\x01\x02"),
        ("noise.usdc", b"PXR-USDC"),
        ("noise.usdz", b"PK\x03\x04"),
        ("table.csv", b"1,2\n"),
        ("empty.usda", b""),
    ],
)
def test_what_is_not_usd_is_refused_in_one_line_with_its_name(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(Error) as raised:
        load(path)
    assert name in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_crate_that_is_too_old_names_the_remedy(tmp_path):
    path = tmp_path / "old.usdc"
    path.write_bytes(b"PXR-USDC" + bytes([0, 0, 1]) + bytes(5 + 200))
    try:
        load(path)
    except Error as error:
        message = str(error)
    if Usd.GetVersion() >= (0, 26, 11):
        assert "pip install 'usd-core<26.11'" in message
    assert "old.usdc" in message


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(Error, match="is a folder"):
        load(tmp_path)


def test_a_mask_that_is_no_prim_path_is_a_wrong_value(read):
    with pytest.raises(ValueError, match="not an absolute prim path"):
        read('def Cube "c" {}', mask=["c"])


@pytest.mark.parametrize("path", ["/nope", "/c/nope"])
def test_a_mask_of_what_is_not_there_is_an_error(read, path):
    with pytest.raises(Error, match=f"^{path}: the mask asks for it"):
        read('def Cube "c" {}', mask=["/c", path])


def test_a_mask_may_reach_into_variants_and_instances(read):
    body = """def "k" { def Cube "c" {} }
        def "a" ( references = </k>\ninstanceable = true ) {}
        def "v" ( variants = { string s = "one"\n }\nprepend variantSets = "s" ) {
        variantSet "s" = { "one" {}\n "two" { def Cube "d" {} } } }"""
    assert len(read(body, mask=["/a/c", "/v/d"], variants={"/v:s": "two"}).meshes) == 2


def test_unresolved_references_are_warned_of_and_the_rest_is_read(examine):
    found = examine('def Cube "c" {}\ndef "r" (references = @gone.usda@) {}')
    assert found.meshes == 1
    assert any("gone.usda" in path for w in found.warnings for path in w.paths)
