"""Displacement moves points along the normal, after subdivision, by constants and textures."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest

from support.shapes import at_corners
from support.usda import CUBE

MATERIAL = """def Material "M" {{
    token outputs:surface.connect = </M/s.outputs:surface>
    def Shader "s" {{
        uniform token info:id = "UsdPreviewSurface"
        float inputs:displacement{displacement}
        token outputs:surface
    }}
    def Shader "t" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @height.exr@
        token inputs:sourceColorSpace = "raw"
        token inputs:wrapS = "clamp"
        token inputs:wrapT = "clamp"
        float4 inputs:scale = ({scale}, 1, 1, 1)
        float2 inputs:st.connect = </M/r.outputs:result>
        float outputs:r
    }}
    def Shader "r" {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}
}}
"""
BOUND = '(prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M>'
TEXTURED = {s: MATERIAL.format(displacement=".connect = </M/t.outputs:r>", scale=s) for s in (1, 3)}
SQUARE = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
"""


@pytest.fixture
def ramp(tmp_path):
    """A picture that rises from about 0 at the left to about 1 at the right, 64 pixels wide."""
    pixels = np.tile((np.arange(64, dtype=np.float32) + 0.5) / 64, (2, 1))[..., None]
    image = oiio.ImageOutput.create(str(tmp_path / "height.exr"))
    image.open(str(tmp_path / "height.exr"), oiio.ImageSpec(64, 2, 1, "float"))
    image.write_image(pixels)
    image.close()


def test_a_sphere_grows_by_a_constant(only_mesh):
    body = (
        MATERIAL.format(displacement=" = 0.5", scale=1)
        + f'def Sphere "s" {BOUND}\ndouble radius = 2 }}'
    )
    mesh = only_mesh(body)
    places, normals = mesh.points[mesh.triangles], at_corners(mesh.normals, mesh)
    assert np.linalg.norm(places, axis=-1) == pytest.approx(np.full(places.shape[:2], 2.5))
    assert normals == pytest.approx(places / 2.5, abs=0.05)


def test_polygons_without_subdivision_move_their_points(only_mesh):
    mesh = only_mesh(
        MATERIAL.format(displacement=" = 0.3", scale=1)
        + f'def Mesh "m" {BOUND}\n{CUBE} uniform token subdivisionScheme = "none" }}'
    )
    # Eight points, each moved along its diagonal in about equal parts: the cube stays closed.
    assert len(mesh.points) == 8
    moved = np.abs(mesh.points) - 1
    assert np.linalg.norm(moved, axis=1) == pytest.approx(np.full(8, 0.3), abs=1e-6)
    assert moved.min() > 0
    assert mesh.normals is None


def test_subdivision_surfaces_are_displaced_after_subdivision(only_mesh):
    """The limit surface of a cube, offset along its normals: parallel to itself."""
    plain = only_mesh(f'def Mesh "m" {{ {CUBE} }}', complexity="high")
    mesh = only_mesh(
        MATERIAL.format(displacement=" = 0.25", scale=1) + f'def Mesh "m" {BOUND}\n{CUBE} }}',
        complexity="high",
    )
    step = (mesh.points - plain.points) / 0.25
    assert np.linalg.norm(step, axis=1) == pytest.approx(np.ones(len(step)), abs=1e-5)
    assert step[plain.triangles] == pytest.approx(at_corners(plain.normals, plain), abs=1e-5)
    assert (
        np.einsum(
            "tci,tci->tc", at_corners(mesh.normals, mesh), at_corners(plain.normals, plain)
        ).min()
        > 0.995
    )


@pytest.mark.parametrize("scheme", ["bilinear", "catmullClark"])
def test_textures_displace(only_mesh, ramp, scheme):
    """The height is the texture's: 3 s, where s = x / 4 (at its edges, half a texel is clamped)."""
    mesh = only_mesh(
        TEXTURED[3]
        + f'def Mesh "m" {BOUND}\n{SQUARE} uniform token subdivisionScheme = "{scheme}" }}',
        complexity="veryhigh",
    )
    st = mesh.primvars["st"]
    inner = (st.values[:, 0] > 0.01) & (st.values[:, 0] < 0.99)
    assert mesh.points[inner, 2] == pytest.approx(3 * st.values[inner, 0], abs=1e-4)
    assert np.ptp(mesh.points[:, 2]) > 2.9
    slope = at_corners(mesh.normals, mesh)[..., 0] / at_corners(mesh.normals, mesh)[..., 2]
    assert np.median(slope) == pytest.approx(-0.75, abs=0.02)  # 3 up over 4 along


def test_left_handed_surfaces_are_displaced_to_their_outside(only_mesh):
    mesh = only_mesh(
        MATERIAL.format(displacement=" = 0.5", scale=1)
        + f'def Mesh "m" {BOUND}\n{SQUARE} uniform token subdivisionScheme = "none"\n'
        'uniform token orientation = "leftHanded" }'
    )
    assert mesh.points[:, 2] == pytest.approx(np.full(4, -0.5))


def test_only_the_faces_of_a_displaced_material_move(read):
    scene = read(
        MATERIAL.format(displacement=" = 0.5", scale=1)
        + """def Mesh "m" {
            int[] faceVertexCounts = [4, 4]
            int[] faceVertexIndices = [0, 1, 2, 3, 4, 5, 6, 7]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0),
                                (2, 0, 0), (3, 0, 0), (3, 1, 0), (2, 1, 0)]
            uniform token subdivisionScheme = "none"
            def GeomSubset "s" (prepend apiSchemas = ["MaterialBindingAPI"]) {
                uniform token elementType = "face"
                uniform token familyName = "materialBind"
                int[] indices = [1]
                rel material:binding = </M>
            } }"""
    )
    assert scene.meshes[0].points[:, 2] == pytest.approx([0] * 4 + [0.5] * 4)


def test_seams_of_texture_coordinates_do_not_tear(only_mesh, ramp):
    """Two faces whose coordinates disagree at their common edge: its points move once."""
    mesh = only_mesh(
        TEXTURED[1]
        + f"""def Mesh "m" {BOUND}
            int[] faceVertexCounts = [4, 4]
            int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
            texCoord2f[] primvars:st = [(0.1, 0), (0.5, 0), (0.5, 1), (0.1, 1),
                                        (0.9, 0), (0.2, 0), (0.2, 1), (0.9, 1)] (
                interpolation = "faceVarying" )
            uniform token subdivisionScheme = "none" }}"""
    )
    assert len(mesh.points) == 6
    assert mesh.points[[0, 2], 2] == pytest.approx([0.1, 0.2], abs=1e-6)
    assert mesh.points[1, 2] == pytest.approx((0.5 + 2 * 0.9) / 3, abs=1e-6) or mesh.points[
        1, 2
    ] == pytest.approx((2 * 0.5 + 0.9) / 3, abs=1e-6)
