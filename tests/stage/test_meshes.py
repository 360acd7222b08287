"""Meshes: orientation, holes, degenerate faces, normals, subsets, displayColor."""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import build
from support.shapes import at_corners, volume
from support.usda import CUBE


def test_right_handed_faces_keep_their_winding(only_mesh):
    mesh = only_mesh(f'def Mesh "m" {{ {CUBE} uniform token subdivisionScheme = "none" }}')
    assert volume(mesh) == pytest.approx(8)


def test_left_handed_faces_are_turned(only_mesh):
    mesh = only_mesh(
        f'def Mesh "m" {{ {CUBE} uniform token subdivisionScheme = "none"\n'
        'uniform token orientation = "leftHanded" }'
    )
    assert volume(mesh) == pytest.approx(-8)


def test_face_varying_values_turn_with_left_handed_faces(only_mesh):
    body = """def Mesh "m" { QUAD
        uniform token orientation = "ORIENTATION"
        normal3f[] normals = [(1, 0, 1), (2, 0, 1), (3, 0, 1), (4, 0, 1)] (
            interpolation = "faceVarying"
        ) }"""
    for orientation in ("rightHanded", "leftHanded"):
        mesh = only_mesh(body.replace("ORIENTATION", orientation))
        tilt = at_corners(mesh.normals, mesh)
        # The normal still belongs to the point it was authored for.
        assert tilt[..., 0] / tilt[..., 2] == pytest.approx(mesh.triangles + 1.0, rel=1e-6)


def test_a_mirroring_transform_is_kept_and_the_faces_with_it(only_mesh):
    mesh = only_mesh(
        f'def Mesh "m" {{ {CUBE} uniform token subdivisionScheme = "none"\n'
        "double3 xformOp:scale = (-1, 1, 1)\n"
        'uniform token[] xformOpOrder = ["xformOp:scale"] }'
    )
    # The winding is that of local space: the core keeps the outside outside.
    assert np.linalg.det(mesh.transform[:3, :3]) == pytest.approx(-1)
    assert volume(mesh) == pytest.approx(8)


def test_holes_are_left_out(only_mesh):
    mesh = only_mesh(
        f'def Mesh "m" {{ {CUBE} uniform token subdivisionScheme = "none"\n'
        "int[] holeIndices = [0, 5] }"
    )
    assert len(mesh.triangles) == 8


def test_faces_without_area_are_left_out_with_a_warning(examine):
    found = examine("""def Mesh "m" {
        int[] faceVertexCounts = [3, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 0, 1, 0, 1, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)]
        uniform token subdivisionScheme = "none" }""")
    assert found.triangles == 1
    assert [w for w in found.warnings if "without area" in w.kind and w.paths == ["/m"]]


@pytest.mark.parametrize(
    "content",
    ["", "int[] faceVertexCounts = []", "point3f[] points = [(0, 0, 0)]"],
)
def test_empty_meshes_are_left_out_with_a_warning(examine, content):
    found = examine(f'def Mesh "m" {{ {content} }}')
    assert found.meshes == 0
    assert any(w.paths == ["/m"] for w in found.warnings)


def test_without_normals_polygons_are_flat(only_mesh):
    assert only_mesh('def Mesh "m" { QUAD }').normals is None


def test_authored_normals_are_made_unit(only_mesh):
    mesh = only_mesh("""def Mesh "m" { QUAD
        normal3f[] normals = [(0, 0, 2), (0, 3, 0), (4, 0, 0), (0, 3, 4)] }""")
    assert mesh.normals.values == pytest.approx(
        np.array([(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0.6, 0.8)])
    )


def test_the_primvar_normals_wins_over_the_attribute(only_mesh):
    mesh = only_mesh("""def Mesh "m" { QUAD
        normal3f[] normals = [(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)]
        normal3f[] primvars:normals = [(0, 1, 0)] ( interpolation = "constant" ) }""")
    assert (at_corners(mesh.normals, mesh) == (0, 1, 0)).all()


def test_indexed_normals_are_looked_up(only_mesh):
    mesh = only_mesh("""def Mesh "m" { QUAD
        normal3f[] primvars:normals = [(0, 1, 0), (0, 0, 1)] ( interpolation = "faceVarying" )
        int[] primvars:normals:indices = [0, 1, 1, 0] }""")
    expected = np.array([(0, 1, 0), (0, 0, 1), (0, 0, 1), (0, 1, 0)])[mesh.triangles]
    assert at_corners(mesh.normals, mesh) == pytest.approx(expected)


def test_normals_without_direction_become_those_of_the_face(only_mesh):
    mesh = only_mesh("""def Mesh "m" { QUAD
        normal3f[] normals = [(0, 0, 0), (0, 1, 0), (nan, 0, 0), (0, 1, 0)] }""")
    normals = at_corners(mesh.normals, mesh)
    broken = np.isin(mesh.triangles, [0, 2])
    assert normals[broken] == pytest.approx(np.tile([0, 0, 1], (broken.sum(), 1)))
    assert normals[~broken] == pytest.approx(np.tile([0, 1, 0], ((~broken).sum(), 1)))


MATERIALS = """
def Material "Red" {
    token outputs:surface.connect = </Red/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        token outputs:surface
    }
}
def Material "Blue" {
    token outputs:surface.connect = </Blue/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 1)
        token outputs:surface
    }
}
"""


def test_face_subsets_bind_materials_per_face(read):
    scene = read(f"""{MATERIALS}
        def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            {CUBE} uniform token subdivisionScheme = "none"
            rel material:binding = </Red>
            def GeomSubset "top" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
                uniform token elementType = "face"
                uniform token familyName = "materialBind"
                int[] indices = [1, 3]
                rel material:binding = </Blue>
            }}
        }}""")
    names = [scene.materials[index].name for index in scene.meshes[0].materials]
    assert names == ["/Red"] * 2 + ["/Blue"] * 2 + ["/Red"] * 2 + ["/Blue"] * 2 + ["/Red"] * 4


def test_meshes_without_material_show_their_display_color(read):
    scene = read("""def Mesh "m" { QUAD
        color3f[] primvars:displayColor = [(0.1, 0.2, 0.3)] ( interpolation = "constant" )
        float[] primvars:displayOpacity = [0.5] }""")
    mesh, material = scene.meshes[0], scene.materials[scene.meshes[0].materials]
    assert material.closure.color.primvar == "displayColor"
    assert material.closure.color.fallback == (0.18, 0.18, 0.18)
    assert material.opacity.primvar == "displayOpacity"
    assert (at_corners(mesh.primvars["displayColor"], mesh) == np.float32([0.1, 0.2, 0.3])).all()
    assert (at_corners(mesh.primvars["displayOpacity"], mesh) == 0.5).all()


@pytest.mark.parametrize("opacity", ["", "float[] primvars:displayOpacity = [1]"])
def test_meshes_that_are_opaque_have_an_opaque_material(read, opacity):
    scene = read(f'def Mesh "m" {{ QUAD {opacity} }}')
    assert scene.materials[scene.meshes[0].materials].opacity == 1.0


def test_points_far_from_the_origin_keep_their_transform_in_double(only_mesh):
    mesh = only_mesh("""def Mesh "m" { QUAD
        double3 xformOp:translate = (123456789.123, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"] }""")
    assert mesh.transform.dtype == np.float64
    assert mesh.transform[3, 0] == 123456789.123


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (1, -2, -1), (-1, -1, -3)])
@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_the_outside_stays_outside_whatever_the_orientation_and_scale(
    read, orientation, scale, scheme
):
    """The core's triangles, seen from outside a cube: shading normals are those of the surface's
    outer side, turned in by left-handedness alone and not by a mirroring transform."""
    scene = read(f"""def Mesh "m" {{ {CUBE} uniform token subdivisionScheme = "{scheme}"
        uniform token orientation = "{orientation}"
        float3 xformOp:scale = {scale}
        uniform token[] xformOpOrder = ["xformOp:scale"] }}""")
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    hits = build(scene).intersect(20 * axes, -axes)
    assert np.isfinite(hits["distance"]).all()
    outward = np.einsum("ij,ij->i", hits["normal"], axes)
    assert outward == pytest.approx(
        np.full(6, 1.0 if orientation == "rightHanded" else -1.0), abs=1e-3
    )
