"""Broken geometry: one line with the prim path, and nothing read."""

from __future__ import annotations

import numpy as np
import pytest

from usdmlt.errors import Error

MESH = """def Xform "x" {{ def Mesh "m" {{
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {indices}
    point3f[] points = {points}
    uniform token subdivisionScheme = "none"
    {extra}
}} }}"""
GOOD = {
    "counts": "[3]",
    "indices": "[0, 1, 2]",
    "points": "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]",
    "extra": "",
}
SUBSET = """def GeomSubset "s" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    uniform token elementType = "face"
    uniform token familyName = "materialBind"
    int[] indices = [0, 7]
}"""
BROKEN = [
    ({"points": "[(0, 0, 0), (nan, 0, 0), (0, 1, 0)]"}, "/x/m: point 1 is not finite"),
    ({"points": "[(0, 0, 0), (1, 0, 0), (0, inf, 0)]"}, "/x/m: point 2 is not finite"),
    ({"indices": "[0, 1, 3]"}, "/x/m: faceVertexIndices has 3, out of range for 3 points"),
    ({"indices": "[0, -1, 2]"}, "/x/m: faceVertexIndices has -1"),
    ({"counts": "[4]"}, "/x/m: faceVertexCounts add up to 4, but there are 3"),
    ({"counts": "[4, -1]"}, "/x/m: faceVertexCounts has a negative count"),
    ({"extra": "int[] holeIndices = [1]"}, "/x/m: holeIndices out of range"),
    ({"extra": SUBSET}, "/x/m/s: indices out of range"),
    (
        {
            "extra": """color3f[] primvars:displayColor = [(1, 0, 0)] ( interpolation = "vertex" )
            int[] primvars:displayColor:indices = [0, 1, 0]"""
        },
        r"/x/m\.primvars:displayColor: primvar indices out of range",
    ),
    (
        {
            "extra": """normal3f[] primvars:normals = [(1, 0, 0)] ( interpolation = "vertex" )
            int[] primvars:normals:indices = [0, -1, 0]"""
        },
        r"/x/m\.primvars:normals: normal indices out of range",
    ),
    (
        {
            "extra": """float3 xformOp:scale = (1, 0, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"]"""
        },
        "/x/m: the transform is singular",
    ),
    (
        {
            "extra": """double3 xformOp:translate = (nan, 0, 1)
            uniform token[] xformOpOrder = ["xformOp:translate"]"""
        },
        "/x/m: the transform is not finite",
    ),
    (
        {"extra": """uniform token[] xformOpOrder = ["nonsense"]"""},
        "Invalid xform op: </x/m.nonsense>",
    ),
]


def test_the_good_mesh_is_read(only_mesh):
    assert len(only_mesh(MESH.format(**GOOD)).triangles) == 1


@pytest.mark.parametrize(("change", "says"), BROKEN)
def test_broken_meshes_name_their_path(read, change, says):
    with pytest.raises(Error, match=says) as raised:
        read(MESH.format(**{**GOOD, **change}))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("typed", ["point3f", "int[]", "int", "texCoord2f[]"])
def test_points_of_a_type_that_is_none_of_points_are_a_warning(read, examine, typed):
    values = {"point3f": "(0, 0, 0)", "int[]": "[0, 1, 2]", "int": "7"}.get(typed, "[(0, 0)]")
    body = f"""def Mesh "m" {{
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        {typed} points = {values}
    }}"""
    assert read(body).meshes == []
    assert ("meshes without points", ["/m"]) in [(w.kind, w.paths) for w in examine(body).warnings]


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('Sphere "x" { string primvars:displayOpacity = "a" }', "string, not float\\[\\]"),
        ('SphereLight "x" { float3[] inputs:color = [(1, 1, 1)] }', "float3\\[\\], not color3f"),
        ('SphereLight "x" { int color = 1 }', "int, not color3f"),
        ('Camera "x" { float shutter:open = 0\ndouble[] shutter:close = [1] }', "not double"),
        ('Camera "x" { int clippingRange = 7 }', "int, not float2"),
        ('Points "x" { point3f[] points = [(0, 0, 0)]\nfloat3[] widths = [(1, 1, 1)] }', "float3"),
        ('PointInstancer "x" { string protoIndices = "a" }', "string, not int\\[\\]"),
        ('RenderSettings "x" { int resolution = 640 }', "int, not int2"),
        ('NurbsPatch "x" { string uVertexCount = "a" }', "string, not int"),
        ('Mesh "x" { QUAD\nint holeIndices = 1 }', "int, not int\\[\\]"),
    ],
)
def test_values_of_another_type_name_their_attribute(read, body, says):
    """USD itself lets them pass."""
    with pytest.raises(Error, match=f"^/x\\.[a-zA-Z:]+ is of type .*{says}") as raised:
        read(f"def {body}")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "value",
    ['token usdmlt:integrator = """two\nlines"""', "matrix4d usdmlt:integrator = ( (1, 0, 0, 0), "
     "(0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )"],
)  # fmt: skip
def test_values_of_several_lines_are_quoted_in_one(read, value):
    with pytest.raises(Error, match=r"^/s: .*integrator (is|must)") as raised:
        read(f'def RenderSettings "s" {{ {value} }}')
    assert "\n" not in str(raised.value)


def test_values_of_another_type_are_named_inside_of_instances_too(read, write):
    write('def "k" { def Cube "c" { string primvars:displayOpacity = "a" } }', name="k.usda")
    with pytest.raises(Error, match=r"^/a/c\.primvars:displayOpacity is of type string"):
        read('def "a" ( references = @./k.usda@</k>\ninstanceable = true ) {}')


def test_numbers_of_another_precision_are_read(read):
    body = """def Sphere "s" { int radius = 2\ndouble3[] primvars:displayColor = [(1, 0, 0)] }
        def DistantLight "l" { double inputs:intensity = 3\nfloat3 inputs:color = (1, 1, 1) }"""
    scene = read(body)
    assert np.abs(scene.meshes[0].points).max() == pytest.approx(2)
    assert scene.lights[0].radiance[0] > 0


@pytest.mark.parametrize("typed", ["normal3f normals = (0, 0, 1)", 'string normals = "up"'])
def test_normals_that_are_no_vectors_are_a_warning(examine, typed):
    found = examine(f'def Mesh "m" {{ QUAD\n{typed} }}').warnings
    kind = "normals that are no vectors are ignored"
    assert [w.paths for w in found if w.kind == kind] == [["/m.normals"]]


def test_very_small_and_very_large_scales_are_not_singular(read):
    body = MESH.format(
        **{
            **GOOD,
            "extra": """float3 xformOp:scale = (1e-6, 1e-6, 1e6)
            uniform token[] xformOpOrder = ["xformOp:scale"]""",
        }
    )
    assert len(read(body).meshes) == 1


@pytest.mark.parametrize(
    "body",
    [
        'def Sphere "s" { double radius = -1 }',
        'def Cube "s" { double size = -1 }',
        'def Cone "s" { double height = nan }',
        'def Cube "s" { string size = "large" }',
        'def SphereLight "s" { string inputs:radius = "large" }',
        'def Camera "s" { string focalLength = "long" }',
    ],
)
def test_sizes_that_are_no_lengths_name_their_path(read, body):
    with pytest.raises(Error, match=r"/s: .*(must be a positive length|not a number)"):
        read(body)


def test_subdivision_of_points_beyond_all_numbers_is_as_they_are(read):
    """Edges whose squares no float holds have no length in pixels."""
    points = "[(0, 0, 0), (1e30, 0, 0), (1e30, 1e30, 0), (0, 1e30, 0)]"
    body = f"""def Mesh "m" {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = {points}
    }}
    def Camera "c" {{ double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"] }}"""
    assert len(read(body).meshes[0].triangles) >= 2


def test_an_axis_that_is_none_names_its_path(read):
    with pytest.raises(Error, match="/s: axis is 'W'; it must be X, Y or Z"):
        read('def Cone "s" { uniform token axis = "W" }')


def test_an_exposure_that_is_no_number_names_the_camera(read):
    with pytest.raises(Error, match="/s: the camera's exposure scales the picture by nan"):
        read('def Camera "s" { float exposure:responsivity = nan }')
