"""NURBS patches and tetrahedral meshes."""

from __future__ import annotations

import numpy as np
import pytest

from support.shapes import volume
from usdmlt.errors import Error

# A quarter of a cylinder of radius 2 about z, from z = 0 to 3: u runs around it.
QUARTER = """
    int uVertexCount = 3
    int vVertexCount = 2
    int uOrder = 3
    int vOrder = 2
    double[] uKnots = [0, 0, 0, 1, 1, 1]
    double[] vKnots = [0, 0, 1, 1]
    double2 uRange = (0, 1)
    double2 vRange = (0, 1)
    point3f[] points = [(2, 0, 0), (2, 2, 0), (0, 2, 0), (2, 0, 3), (2, 2, 3), (0, 2, 3)]
    double[] pointWeights = [1, 0.7071067811865476, 1, 1, 0.7071067811865476, 1]
"""


def test_a_rational_quarter_cylinder_has_its_radius_and_normals(only_mesh):
    mesh = only_mesh(f'def NurbsPatch "p" {{ {QUARTER} }}')
    around = mesh.points[:, :2].astype(float)
    assert np.linalg.norm(around, axis=1) == pytest.approx(np.full(len(around), 2), abs=1e-6)
    assert mesh.normals.values == pytest.approx(
        np.column_stack([around / 2, np.zeros(len(around))]), abs=1e-5
    )
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    normal = np.cross(b - a, c - a)
    assert np.linalg.norm(normal, axis=1).sum() / 2 == pytest.approx(np.pi * 3, rel=1e-3)
    assert np.einsum("ij,ij->i", normal, mesh.normals.values[mesh.triangles[:, 0]]).min() > 0


def test_left_handed_patches_face_the_other_way(only_mesh):
    mesh = only_mesh(f'def NurbsPatch "p" {{ {QUARTER} uniform token orientation = "leftHanded" }}')
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    normal = np.cross(b - a, c - a)
    assert np.einsum("ij,ij->i", normal, a * (1, 1, 0)).max() < 0
    assert np.einsum("ij,ij->i", normal, mesh.normals.values[mesh.triangles[:, 0]]).min() > 0


def test_without_weights_a_patch_is_a_polynomial(only_mesh):
    """Control heights 0, 0, 1 along u are the parabola u²."""
    mesh = only_mesh("""def NurbsPatch "p" {
        int uVertexCount = 3
        int vVertexCount = 2
        int uOrder = 3
        int vOrder = 2
        double[] uKnots = [0, 0, 0, 1, 1, 1]
        double[] vKnots = [0, 0, 1, 1]
        point3f[] points = [(0, 0, 0), (0.5, 0, 0), (1, 0, 1), (0, 1, 0), (0.5, 1, 0), (1, 1, 1)]
        color3f[] primvars:displayColor = [(0, 0, 0), (0, 0, 0), (1, 0, 0),
                                           (0, 0, 0), (0, 0, 0), (1, 0, 0)] (
            interpolation = "vertex" ) }""")
    assert mesh.points[:, 2] == pytest.approx(mesh.points[:, 0] ** 2, abs=1e-6)
    color = mesh.primvars["displayColor"]
    assert color.values[:, 0] == pytest.approx(mesh.points[:, 2], abs=1e-6)


def test_a_range_cuts_a_patch(only_mesh):
    mesh = only_mesh(
        f'def NurbsPatch "p" {{ {QUARTER} }}'.replace("vRange = (0, 1)", "vRange = (0.5, 1)")
    )
    assert mesh.points[:, 2].min() == pytest.approx(1.5)


def test_a_pole_has_a_normal(only_mesh):
    mesh = only_mesh(
        f'def NurbsPatch "p" {{ {QUARTER} }}'.replace(
            "(2, 0, 3), (2, 2, 3), (0, 2, 3)", "(0, 0, 3), (0, 0, 3), (0, 0, 3)"
        )
    )
    assert np.linalg.norm(mesh.normals.values, axis=1) == pytest.approx(
        np.ones(len(mesh.points)), abs=1e-5
    )
    top = mesh.normals.values[mesh.points[:, 2] == 3]
    assert (top[:, 2] > 0.3).all()


@pytest.mark.parametrize(
    ("replace", "by", "says"),
    [
        ("uVertexCount = 3", "uVertexCount = 4", "4 x 2 vertices"),
        ("uKnots = [0, 0, 0, 1, 1, 1]", "uKnots = [0, 0, 1, 1]", "uKnots"),
        ("vKnots = [0, 0, 1, 1]", "vKnots = [0, 1, 0, 1]", "must not fall"),
        ("uOrder = 3", "uOrder = 4", "uOrder"),
        ("pointWeights = [1,", "pointWeights = [-1,", "pointWeights"),
    ],
)
def test_broken_patches_name_their_path(read, replace, by, says):
    with pytest.raises(Error, match=f"/p: .*{says}"):
        read(f'def NurbsPatch "p" {{ {QUARTER} }}'.replace(replace, by))


def test_trim_curves_are_warned_of(examine):
    found = examine(f'def NurbsPatch "p" {{ {QUARTER} int[] trimCurve:counts = [1] }}')
    assert [w.paths for w in found.warnings if "trim" in w.kind] == [["/p"]]


# ---------------------------------------------------------------------------------------------
# Tetrahedra

TETS = """
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)]
    int4[] tetVertexIndices = [(0, 1, 2, 3), (1, 4, 2, 3)]
"""


@pytest.mark.parametrize("authored", [False, True])
def test_tetrahedral_meshes_show_their_surface(only_mesh, authored):
    surface = """int3[] surfaceFaceVertexIndices = [
        (0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 4), (1, 4, 3), (2, 3, 4)]"""
    mesh = only_mesh(f'def TetMesh "t" {{ {TETS} {surface if authored else ""} }}')
    assert len(mesh.triangles) == 6
    assert volume(mesh) == pytest.approx(1 / 6 + 1 / 3)


def test_broken_tetrahedra_name_their_path(read):
    with pytest.raises(Error, match="/t: tetVertexIndices out of range"):
        read(f'def TetMesh "t" {{ {TETS} }}'.replace("(1, 4, 2, 3)", "(1, 5, 2, 3)"))
