"""Points are spheres: one of them many times, or a mesh of all where they differ."""

from __future__ import annotations

import numpy as np
import pytest

from support.coverage import CAMERA, covered, pixels
from usdmlt.errors import Error
from usdmlt.stage.points import icosphere

POINTS = """def Points "p" {{
    point3f[] points = [(-1, 0, 0), (1, 0.5, 0), (0, -1, 0)]
    float[] widths = {widths}
    {extra} }}"""
COLORS = """color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] (
        interpolation = "vertex"
    )"""


@pytest.mark.parametrize("extra", ["", COLORS])
def test_points_cover_the_area_of_their_circles(read, extra):
    scene = read(CAMERA + POINTS.format(widths="[0.5, 1, 0.1]", extra=extra), width=64, height=64)
    expected = np.pi / 4 * (0.25 + 1 + 0.01)
    assert covered(scene) == pytest.approx(expected, rel=0.01)


def test_points_that_look_alike_are_instances_of_one_sphere(read):
    scene = read(POINTS.format(widths="[0.5, 1, 0.1]", extra=""))
    assert len(scene.prototypes) == 1
    transforms = scene.instances[0].transforms
    assert transforms[:, 0, 0] == pytest.approx([0.25, 0.5, 0.05])
    assert transforms[:, 3, :3] == pytest.approx(np.array([(-1, 0, 0), (1, 0.5, 0), (0, -1, 0)]))


@pytest.mark.parametrize("extra", ["", COLORS])
def test_a_point_looks_like_a_sphere(read, extra):
    """Pixel by pixel, within what a polyhedron is off: a twentieth of a pixel at the rim, and the
    noise of 64 samples there."""
    body = POINTS.format(widths="[1.6, 0, 0]", extra=extra).replace("(-1, 0, 0)", "(-0.2, 0.1, 0)")
    sphere = """def Sphere "s" { double radius = 0.8
        double3 xformOp:translate = (-0.2, 0.1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"] }"""
    point, other = (pixels(read(CAMERA + b, width=64, height=64)) for b in (body, sphere))
    assert point.sum() == pytest.approx(other.sum(), rel=0.005)
    assert np.abs(point - other).max() < 0.3
    assert ((other == 1) <= (point > 0.7)).all()


def test_values_of_points_stay_with_their_sphere(only_mesh):
    mesh = only_mesh(POINTS.format(widths="[0.5, 0.5, 0.5]", extra=COLORS))
    color = mesh.primvars["displayColor"]
    corners = mesh.triangles if color.corners is None else color.corners
    x = mesh.points[mesh.triangles][..., 0].mean(axis=1)
    expected = np.where(
        x[:, None] < -0.5, [1, 0, 0], np.where(x[:, None] > 0.5, [0, 1, 0], [0, 0, 1])
    )
    assert (color.values[corners] == expected[:, None]).all()


def test_points_inside_instances_are_placed_with_them(read):
    scene = read("""
        class "P" { def Points "p" {
            point3f[] points = [(1, 0, 0), (2, 0, 0)]
            float[] widths = [0.2] } }
        def Xform "a" (instanceable = true
            references = </P>
        ) {}
        def Xform "b" (instanceable = true
            references = </P>
        ) { double3 xformOp:translate = (0, 5, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }""")
    places = sorted(t[3, :2].tolist() for i in scene.instances for t in i.transforms)
    assert places == [[1, 0], [1, 5], [2, 0], [2, 5]]


@pytest.mark.parametrize("level", [0, 1, 3])
def test_spheres_of_triangles_are_closed_and_face_outwards(level):
    vertices, faces = icosphere(level)
    assert len(faces) == 20 * 4**level
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(np.ones(len(vertices)))
    edges = np.sort(faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    assert (np.einsum("ij,ij->i", a, np.cross(b, c)) > 0).all()


def test_points_without_widths_say_how_wide_they_are(examine):
    found = examine('def Points "p" { point3f[] points = [(0, 0, 0)] }')
    assert [w.paths for w in found.warnings if "1 wide" in w.kind] == [["/p"]]
    assert found.meshes == 1


def test_widths_that_do_not_fit_are_warned_of(examine):
    found = examine(POINTS.format(widths="[1, 2]", extra=""))
    assert [w.paths for w in found.warnings if "widths" in w.kind] == [["/p"]]


def test_broken_points_name_their_path(read):
    with pytest.raises(Error, match="/p: point 0 is not finite"):
        read('def Points "p" { point3f[] points = [(0, nan, 0)] }')


def test_points_under_a_transform_that_is_no_number_name_their_path(read):
    extra = (
        COLORS
        + """
    matrix4d xformOp:transform = ((inf, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    uniform token[] xformOpOrder = ["xformOp:transform"]"""
    )
    with pytest.raises(Error, match=r"^/p: the transform is not finite$"):
        read(POINTS.format(widths="[0.5, 1, 0.1]", extra=extra))
