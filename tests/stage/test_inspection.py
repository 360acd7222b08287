"""inspect says what would be rendered, and what not."""

from __future__ import annotations

from usdmlt.stage import inspect

BODY = """
def Camera "shot" {}
class "P" { def Cube "c" {} }
def Xform "a" (instanceable = true
    references = </P>
) {}
def Xform "b" (instanceable = true
    references = </P>
) {}
def Mesh "m" { QUAD }
def FluffyCloud "p" {}
def RectLight "l" {}
"""


def test_what_is_counted(examine):
    found = examine(BODY, 'upAxis = "Z"\nmetersPerUnit = 0.01\nstartTimeCode = 7', width=100)
    assert (found.camera, found.camera_reason) == ("/shot", "the only camera")
    assert (found.width, found.frame, found.up_axis) == (100, 7, "Z")
    assert found.meters_per_unit == 0.01
    assert (found.meshes, found.prototypes, found.instances) == (2, 1, 2)
    assert (found.triangles, found.triangles_instanced) == (12 + 2, 24 + 2)
    assert found.lights == [("RectLight", "/l")]
    assert found.materials == ["displayColor"]
    assert found.purposes == ["default", "render"]
    assert [str(w) for w in found.warnings] == ["FluffyCloud prims are not rendered: /p"]


def test_it_logs_nothing(write, caplog):
    inspect(write(BODY))
    assert caplog.records == []


def test_the_automatic_camera_says_why(examine):
    found = examine('def Camera "a" {}\ndef Camera "b" {}')
    assert found.camera == ""
    assert "none of several cameras was asked for (/a, /b)" in found.camera_reason
