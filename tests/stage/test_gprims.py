"""The analytic gprims: on their surfaces, outward, of their size, with unit (s, t)."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from usdmlt.stage import load

SHAPES = {
    "Sphere": ("double radius = 2", 4 / 3 * np.pi * 8, 4 * np.pi * 4),
    "Cube": ("double size = 3", 27.0, 54.0),
    "Cylinder": ("double radius = 2\ndouble height = 5", np.pi * 4 * 5, 2 * np.pi * 4 + 20 * np.pi),
    "Cone": (
        "double radius = 3\ndouble height = 4",
        np.pi * 9 * 4 / 3,
        np.pi * 9 + np.pi * 3 * 5,
    ),
    "Capsule": (
        "double radius = 2\ndouble height = 5",
        np.pi * 4 * 5 + 4 / 3 * np.pi * 8,
        20 * np.pi + 16 * np.pi,
    ),
    "Cylinder_1": (
        "double radiusBottom = 3\ndouble radiusTop = 1\ndouble height = 4",
        np.pi * 4 / 3 * (9 + 3 + 1),
        np.pi * (9 + 1) + np.pi * (3 + 1) * np.sqrt(4 + 16),
    ),
    "Capsule_1": (
        "double radiusBottom = 2\ndouble radiusTop = 2\ndouble height = 5",
        np.pi * 4 * 5 + 4 / 3 * np.pi * 8,
        20 * np.pi + 16 * np.pi,
    ),
}


def measure(mesh):
    """Volume and area."""
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    normal = np.cross(b - a, c - a)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6, np.linalg.norm(normal, axis=1).sum() / 2


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_volume_and_area_are_those_of_the_shape(only_mesh, kind, axis):
    sizes, volume, area = SHAPES[kind]
    mesh = only_mesh(f'def {kind} "s" {{ {sizes}\nuniform token axis = "{axis}" }}')
    measured = measure(mesh)
    # 96 segments around: a circle's area is 0.07 % short, a sphere's volume 0.2 %.
    assert measured == pytest.approx((volume, area), rel=4e-3)


@pytest.mark.parametrize("kind", [*SHAPES, "Plane"])
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_extents_are_those_that_usd_computes(write, kind, axis):
    sizes = SHAPES.get(kind, ("double width = 2\ndouble length = 3", 0, 0))[0]
    stage = Usd.Stage.Open(
        str(write(f'def {kind} "s" {{ {sizes}\nuniform token axis = "{axis}" }}'))
    )
    prim = UsdGeom.Boundable(stage.GetPrimAtPath("/s"))
    extent = UsdGeom.Boundable.ComputeExtentFromPlugins(prim, Usd.TimeCode.Default())
    points = load(stage).meshes[0].points
    assert np.array([points.min(axis=0), points.max(axis=0)]) == pytest.approx(
        np.array(extent), abs=1e-5
    )


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_cones_point_along_their_axis(only_mesh, axis):
    mesh = only_mesh(f'def Cone "s" {{ uniform token axis = "{axis}" }}')
    along = mesh.points[:, "XYZ".index(axis)]
    around = np.delete(mesh.points, "XYZ".index(axis), axis=1)
    assert np.abs(around[along > 0.99]).max() < 1e-6
    assert np.linalg.norm(around, axis=1)[along < -0.99].max() == pytest.approx(1)


@pytest.mark.parametrize("kind", [*SHAPES, "Plane"])
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_normals_are_unit_and_face_like_the_triangles(only_mesh, kind, axis):
    sizes = SHAPES.get(kind, ("", 0, 0))[0]
    mesh = only_mesh(f'def {kind} "s" {{ {sizes}\nuniform token axis = "{axis}" }}')
    assert np.linalg.norm(mesh.normals.values, axis=1) == pytest.approx(
        np.ones(len(mesh.points)), abs=1e-6
    )
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    face = np.cross(b - a, c - a)
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    for i in range(3):
        normal = mesh.normals.values[mesh.triangles[:, i]]
        assert np.einsum("ij,ij->i", face, normal).min() > 0.99


def test_sphere_normals_are_exact(only_mesh):
    mesh = only_mesh('def Sphere "s" { double radius = 3 }')
    assert mesh.points == pytest.approx(3 * mesh.normals.values, abs=1e-6)


def test_cone_normals_lean_by_its_slope(only_mesh):
    mesh = only_mesh('def Cone "s" { double radius = 3\ndouble height = 4 }')
    side = mesh.normals.values[:, 2] > -0.5
    assert mesh.normals.values[side, 2] == pytest.approx(np.full(side.sum(), 3 / 5), abs=1e-6)


@pytest.mark.parametrize(
    ("axis", "extent", "normal"),
    [("X", (0, 3, 2), (1, 0, 0)), ("Y", (2, 0, 3), (0, 1, 0)), ("Z", (2, 3, 0), (0, 0, 1))],
)
def test_planes_lie_across_their_axis(only_mesh, axis, extent, normal):
    mesh = only_mesh(
        f'def Plane "p" {{ double width = 2\ndouble length = 3\nuniform token axis = "{axis}" }}'
    )
    assert np.ptp(mesh.points, axis=0) == pytest.approx(extent)
    assert (mesh.normals.values == normal).all()


@pytest.mark.parametrize("kind", ["Sphere", "Capsule_1", "Cylinder", "Cone", "Cube"])
def test_left_handed_shapes_are_inside_out(only_mesh, kind):
    outward, _ = measure(only_mesh(f'def {kind} "s" {{}}'))
    inward, _ = measure(only_mesh(f'def {kind} "s" {{ uniform token orientation = "leftHanded" }}'))
    assert inward == pytest.approx(-outward)


def test_a_capsule_of_unequal_radii_is_smooth_where_its_parts_meet(only_mesh):
    mesh = only_mesh("""def Capsule_1 "s" {
        double radiusBottom = 2
        double radiusTop = 1
        double height = 4
        uniform token axis = "Z" }""")
    # Points at the same place have the same normal, except none at the two poles' rings.
    places, inverse = np.unique(np.round(mesh.points, 5), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    mean = np.zeros((len(places), 3))
    np.add.at(mean, inverse, mesh.normals.values)
    count = np.bincount(inverse)[:, None]
    assert np.linalg.norm(mean / count, axis=1) == pytest.approx(np.ones(len(places)), abs=1e-4)


@pytest.mark.parametrize("kind", [*SHAPES, "Plane"])
def test_texture_coordinates_span_the_unit_square(read, kind):
    scene = read(f"""
        def Material "M" {{
            token outputs:surface.connect = </M/s.outputs:surface>
            def Shader "s" {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </M/reader.outputs:result>
                token outputs:surface
            }}
            def Shader "reader" {{
                uniform token info:id = "UsdPrimvarReader_float3"
                string inputs:varname = "st"
                float3 outputs:result
            }}
        }}
        def {kind} "s" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            rel material:binding = </M>
        }}""")
    st = scene.meshes[0].primvars["st"].values
    assert (st.min(axis=0), st.max(axis=0)) == (pytest.approx([0, 0]), pytest.approx([1, 1]))


@pytest.mark.parametrize(
    "body",
    [
        'def Sphere "s" { double radius = 0 }',
        'def Cylinder "s" { double height = 0 }',
        'def Cube "s" { double size = 0 }',
        'def Plane "s" { double width = 0 }',
        'def Cone "s" { double radius = 0 }',
        'def Capsule "s" { double radius = 0 }',
    ],
)
def test_shapes_without_extent_are_left_out_with_a_warning(examine, body):
    found = examine(body)
    assert found.meshes == 0
    assert any(w.paths == ["/s"] for w in found.warnings)
