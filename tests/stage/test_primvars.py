"""Every interpolation of primvars, indexed and not, arrives at the right corners."""

from __future__ import annotations

import numpy as np
import pytest

# Two quads side by side: points 0-5, faces (0 1 4 3) and (1 2 5 4).
MESH = """
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    uniform token subdivisionScheme = "none"
"""
CORNERS = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])  # face corners of the triangles
POINTS = np.array([0, 1, 4, 3, 1, 2, 5, 4])[CORNERS]
FACES = np.array([[0] * 3, [0] * 3, [1] * 3, [1] * 3])
ELEMENTS = {
    "constant": (1, 0 * CORNERS),
    "uniform": (2, FACES),
    "varying": (6, POINTS),
    "vertex": (6, POINTS),
    "faceVarying": (8, CORNERS),
}


def colors(count: int) -> tuple[np.ndarray, str]:
    """Distinct colours, and their text."""
    values = np.arange(3 * count, dtype=np.float32).reshape(count, 3) / 64
    return values, str([tuple(float(c) for c in row) for row in values])


def values_at_corners(mesh, name="displayColor"):
    primvar = mesh.primvars[name]
    return primvar.values[mesh.triangles if primvar.corners is None else primvar.corners]


@pytest.mark.parametrize("interpolation", ELEMENTS)
def test_plain_primvars(only_mesh, interpolation):
    count, elements = ELEMENTS[interpolation]
    values, text = colors(count)
    mesh = only_mesh(f"""def Mesh "m" {{ {MESH}
        color3f[] primvars:displayColor = {text} ( interpolation = "{interpolation}" ) }}""")
    assert np.array_equal(values_at_corners(mesh), values[elements])


@pytest.mark.parametrize("interpolation", ELEMENTS)
def test_indexed_primvars(only_mesh, interpolation):
    count, elements = ELEMENTS[interpolation]
    values, text = colors(3)
    indices = [(2 * i + 1) % 3 for i in range(count)]
    mesh = only_mesh(f"""def Mesh "m" {{ {MESH}
        color3f[] primvars:displayColor = {text} ( interpolation = "{interpolation}" )
        int[] primvars:displayColor:indices = {indices} }}""")
    assert np.array_equal(values_at_corners(mesh), values[np.array(indices)[elements]])


def test_constant_primvars_are_inherited(only_mesh):
    mesh = only_mesh(f"""def Xform "x" {{
        color3f[] primvars:displayColor = [(0.25, 0.5, 0.75)] ( interpolation = "constant" )
        def Mesh "m" {{ {MESH} }} }}""")
    assert (values_at_corners(mesh) == (0.25, 0.5, 0.75)).all()


def test_other_primvars_are_not_inherited(only_mesh):
    mesh = only_mesh(f"""def Xform "x" {{
        color3f[] primvars:displayColor = [(0, 0, 0), (1, 1, 1)] ( interpolation = "uniform" )
        def Mesh "m" {{ {MESH} }} }}""")
    assert "displayColor" not in mesh.primvars


def test_primvars_of_the_wrong_length_are_ignored_with_a_warning(examine):
    found = examine(f"""def Mesh "m" {{ {MESH}
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" ) }}""")
    warning = next(w for w in found.warnings if "number of values" in w.kind)
    assert warning.paths == ["/m.primvars:displayColor (2 vertex)"]


def test_values_that_are_not_finite_are_read_as_0_with_a_warning(only_mesh, examine):
    body = f"""def Mesh "m" {{ {MESH}
        color3f[] primvars:displayColor = [(nan, 0.5, inf)] ( interpolation = "constant" ) }}"""
    assert values_at_corners(only_mesh(body))[0, 0].tolist() == [0, 0.5, 0]
    assert any(w.paths == ["/m.primvars:displayColor"] for w in examine(body).warnings)


def test_a_single_value_is_a_constant(only_mesh):
    mesh = only_mesh(f"""def Mesh "m" {{ {MESH}
        color3f primvars:displayColor = (0.25, 0.5, 0.75) }}""")
    assert (values_at_corners(mesh) == (0.25, 0.5, 0.75)).all()


@pytest.mark.parametrize("type_name", ["texCoord2f", "float2", "texCoord2d", "half2", "texCoord3f"])
def test_texture_coordinates_may_have_any_precision_and_width(only_mesh, type_name):
    text = "[(0.5, 0.25, 1)]" if "3" in type_name else "[(0.5, 0.25)]"
    mesh = only_mesh(f"""
        def Material "M" {{
            token outputs:surface.connect = </M/s.outputs:surface>
            def Shader "s" {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </M/reader.outputs:result>
                token outputs:surface
            }}
            def Shader "reader" {{
                uniform token info:id = "UsdPrimvarReader_float3"
                string inputs:varname = "uv"
                float3 outputs:result
            }}
        }}
        def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {MESH}
            rel material:binding = </M>
            {type_name}[] primvars:uv = {text} ( interpolation = "constant" ) }}""")
    uv = values_at_corners(mesh, "uv")
    assert uv.dtype == np.float32
    assert (uv[..., :2] == (0.5, 0.25)).all()


def test_only_the_primvars_that_materials_read_are_kept(only_mesh):
    mesh = only_mesh(f"""def Mesh "m" {{ {MESH}
        float[] primvars:unused = [1] ( interpolation = "constant" )
        texCoord2f[] primvars:st = [(0, 0)] ( interpolation = "constant" ) }}""")
    assert mesh.primvars == {}
