"""Subdivision surfaces as USD has them: attributes, primvars, subsets, and how fine they are."""

from __future__ import annotations

import numpy as np
import pytest

from support.shapes import at_corners, face_normals, volume
from support.usda import CUBE
from usdmlt.errors import Error
from usdmlt.scene import Mesh

# Two by two cells; vertex 4 is in the middle.
SHEET = """
    int[] faceVertexCounts = [4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0),
                        (0, 2, 0), (1, 2, 0), (2, 2, 0)]
"""


# ---------------------------------------------------------------------------------------------
# Shape


def test_a_cube_without_scheme_is_catmull_clark(only_mesh):
    mesh = only_mesh(f'def Mesh "m" {{ {CUBE} }}', complexity="veryhigh")
    # The limit surface of a cube is nearly a sphere through (1/2, 1/2, 1/2).
    radii = np.linalg.norm(mesh.points, axis=1)
    assert radii.min() > 0.66 and radii.max() < 0.88
    assert np.linalg.norm(mesh.points[:8], axis=1) == pytest.approx(np.full(8, np.sqrt(0.75)))
    assert np.einsum("tci,ti->tc", at_corners(mesh.normals, mesh), face_normals(mesh)).min() > 0.98


def test_authored_normals_are_not_those_of_a_subdivision_surface(only_mesh):
    """Its limit has its own; on polygons they count."""
    normals = "normal3f[] normals = [" + ", ".join(["(0, 0, 1)"] * 8) + "]\n"
    plain = only_mesh(f'def Mesh "m" {{ {CUBE} }}', complexity="medium")
    smooth = only_mesh(f'def Mesh "m" {{ {CUBE}\n{normals} }}', complexity="medium")
    assert np.array_equal(at_corners(smooth.normals, smooth), at_corners(plain.normals, plain))
    scheme = 'uniform token subdivisionScheme = "none"\n'
    polygons = only_mesh(f'def Mesh "m" {{ {CUBE}\n{normals}{scheme} }}')
    assert (at_corners(polygons.normals, polygons) == (0, 0, 1)).all()


@pytest.mark.parametrize("complexity", ["low", "medium", "high", "veryhigh"])
def test_complexity_is_the_level(only_mesh, complexity):
    mesh = only_mesh(f'def Mesh "m" {{ {CUBE} }}', complexity=complexity)
    level = ["low", "medium", "high", "veryhigh"].index(complexity)
    assert len(mesh.triangles) == 12 * 4**level


def test_edges_are_one_to_two_pixels_long_where_nothing_else_is_asked(read):
    """A cube of 2 units that is w/10 pixels wide, with w the picture's width."""
    body = f"""def Mesh "m" {{ {CUBE} }}
        def Camera "c" {{ token projection = "orthographic"
            float horizontalAperture = 200
            float verticalAperture = 200
            double3 xformOp:translate = (0, 0, 10)
            uniform token[] xformOpOrder = ["xformOp:translate"] }}"""
    for width in (100, 400, 1600):
        scene = read(body, width=width, height=width)
        mesh = scene.meshes[0]
        edges = len(mesh.triangles) / 12
        pixels = 2 * width / 20 / np.sqrt(edges)
        assert 1 < pixels <= 2


def test_of_many_instances_the_largest_in_the_picture_counts(read):
    body = f"""def Mesh "m" {{ {CUBE} }}
        class "P" {{ def Mesh "p" {{ {CUBE} }} }}
        def Xform "far" (instanceable = true
            references = </P>
        ) {{ double3 xformOp:translate = (0, 0, -100)
            uniform token[] xformOpOrder = ["xformOp:translate"] }}
        def Xform "near" (instanceable = true
            references = </P>
        ) {{ }}
        def Camera "c" {{ double3 xformOp:translate = (0, 0, 20)
            uniform token[] xformOpOrder = ["xformOp:translate"] }}"""
    scene = read(body, width=200)
    single, shared = scene.meshes[0], scene.prototypes[0].meshes[0]
    assert len(shared.triangles) == len(single.triangles) > 12


def test_left_handed_surfaces_are_the_same_seen_from_the_other_side(only_mesh):
    right = only_mesh(f'def Mesh "m" {{ {CUBE} }}', complexity="high")
    left = only_mesh(
        f'def Mesh "m" {{ {CUBE} uniform token orientation = "leftHanded" }}', complexity="high"
    )
    assert volume(left) == pytest.approx(-volume(right), rel=1e-6)
    facing = np.einsum("tci,ti->tc", at_corners(left.normals, left), face_normals(left))
    assert facing.min() > 0.9


def test_infinitely_sharp_creases_keep_a_cube_a_cube(only_mesh):
    edges = "[0, 1, 1, 3, 3, 2, 2, 0, 4, 5, 5, 7, 7, 6, 6, 4, 0, 4, 1, 5, 2, 6, 3, 7]"
    body = f"""def Mesh "m" {{ {CUBE}
        int[] creaseIndices = {edges}
        int[] creaseLengths = [2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2]
        float[] creaseSharpnesses = {[10.0] * 12} }}"""
    mesh = only_mesh(body, complexity="high")
    assert np.abs(mesh.points).max(axis=1) == pytest.approx(np.ones(len(mesh.points)))
    assert volume(mesh) == pytest.approx(8)
    assert at_corners(mesh.normals, mesh) == pytest.approx(
        np.repeat(face_normals(mesh)[:, None], 3, axis=1), abs=1e-6
    )


def test_sharpness_may_be_given_per_crease_or_per_edge(only_mesh):
    body = f"""def Mesh "m" {{ {CUBE}
        int[] creaseIndices = [0, 1, 3, 2]
        int[] creaseLengths = [4]
        float[] creaseSharpnesses = SHARP }}"""
    one = only_mesh(body.replace("SHARP", "[2]"), complexity="high")
    each = only_mesh(body.replace("SHARP", "[2, 2, 2]"), complexity="high")
    other = only_mesh(body.replace("SHARP", "[2, 2, 0]"), complexity="high")
    assert np.array_equal(one.points, each.points)
    assert not np.allclose(one.points, other.points, atol=1e-3)


def test_sharp_corners_stay(only_mesh):
    mesh = only_mesh(
        f"""def Mesh "m" {{ {CUBE} int[] cornerIndices = [7]
        float[] cornerSharpnesses = [10] }}""",
        complexity="high",
    )
    assert mesh.points[7].tolist() == [1, 1, 1]
    assert np.abs(mesh.points[6]).max() < 0.6


@pytest.mark.parametrize(
    ("boundary", "corner", "triangles"),
    [("edgeAndCorner", (0, 0), 32), ("edgeOnly", (1 / 6, 1 / 6), 32), ("none", None, 0)],
)
def test_boundaries_are_interpolated_as_asked(read, boundary, corner, triangles):
    """Along a smooth boundary the corner moves by 1/6 of each neighbour. Without interpolation the
    faces beside the boundary, here all, are not there."""
    scene = read(
        f'def Mesh "m" {{ {SHEET} token interpolateBoundary = "{boundary}" }}', complexity="medium"
    )
    assert sum(len(mesh.triangles) for mesh in scene.meshes) == triangles
    if corner is not None:
        assert scene.meshes[0].points[0, :2] == pytest.approx(corner)


def test_holes_are_gone_but_shape_what_is_around_them(only_mesh):
    whole = only_mesh(f'def Mesh "m" {{ {CUBE} }}', complexity="high")
    holed = only_mesh(f'def Mesh "m" {{ {CUBE} int[] holeIndices = [5] }}', complexity="high")
    assert len(holed.triangles) == len(whole.triangles) * 5 // 6
    assert np.array_equal(holed.points, whole.points)
    used = holed.points[np.unique(holed.triangles)]
    assert used[:, 0].max() < 0.7 < whole.points[:, 0].max()


def test_loop_takes_triangles_and_splits_what_is_not(read, examine):
    body = 'def Mesh "m" { CUBE uniform token subdivisionScheme = "loop" }'.replace("CUBE", CUBE)
    mesh = read(body, complexity="veryhigh").meshes[0]
    assert len(mesh.triangles) == 12 * 4**3
    assert np.linalg.norm(mesh.points, axis=1).max() < 1
    assert [w.paths for w in examine(body).warnings if "Loop" in w.kind] == [["/m"]]


def test_bilinear_surfaces_are_their_flat_faces(only_mesh):
    mesh = only_mesh(
        f'def Mesh "m" {{ {CUBE} uniform token subdivisionScheme = "bilinear" }}', complexity="high"
    )
    assert np.abs(mesh.points).max(axis=1) == pytest.approx(np.ones(len(mesh.points)))
    assert at_corners(mesh.normals, mesh) == pytest.approx(
        np.repeat(face_normals(mesh)[:, None], 3, axis=1), abs=1e-6
    )


# ---------------------------------------------------------------------------------------------
# Values

PRIMVAR = """def Mesh "m" {{ {cage}
    token faceVaryingLinearInterpolation = "{rule}"
    color3f[] primvars:displayColor = {values} ( interpolation = "{interpolation}" ) }}"""


def colors_at(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Red values at triangle corners, and their places."""
    return at_corners(mesh.primvars["displayColor"], mesh)[..., 0], mesh.points[mesh.triangles]


def reds(values) -> str:
    return "[" + ", ".join(f"({value}, 0, 0)" for value in values) + "]"


def test_uniform_values_go_to_all_of_a_face(only_mesh):
    mesh = only_mesh(
        PRIMVAR.format(cage=SHEET, rule="none", values=reds([0, 1, 2, 3]), interpolation="uniform"),
        complexity="high",
    )
    red, places = colors_at(mesh)
    center = places.mean(axis=1)
    assert (red == (1.0 * (center[:, 0] > 1) + 2 * (center[:, 1] > 1))[:, None]).all()


def test_vertex_values_are_subdivided_as_points_are_and_varying_ones_are_linear(only_mesh):
    bump = reds([0, 0, 0, 0, 1, 0, 0, 0, 0])
    peaks = {}
    for interpolation in ("vertex", "varying"):
        mesh = only_mesh(
            PRIMVAR.format(cage=SHEET, rule="none", values=bump, interpolation=interpolation),
            complexity="high",
        )
        red, places = colors_at(mesh)
        peaks[interpolation] = red[(places == (1, 1, 0)).all(axis=-1)]
        if interpolation == "varying":  # products of quarters, at level 2
            assert np.isin(red * 16, range(17)).all()
    assert peaks["vertex"] == pytest.approx(np.full_like(peaks["vertex"], 4 / 9))
    assert (peaks["varying"] == 1).all()


def test_vertex_values_equal_to_points_stay_equal(only_mesh):
    mesh = only_mesh(
        PRIMVAR.format(
            cage=CUBE,
            rule="none",
            values="[(-1, -1, -1), (1, -1, -1), (-1, 1, -1), (1, 1, -1), "
            "(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1)]",
            interpolation="vertex",
        ),
        complexity="high",
    )
    assert mesh.primvars["displayColor"].values == pytest.approx(mesh.points, abs=1e-6)


@pytest.mark.parametrize(
    ("rule", "corner", "edge", "middle"),
    [
        ("none", 1 / 6, 4 / 3, 4 / 3),
        ("cornersOnly", 0, 4 / 3, 4 / 3),
        ("cornersPlus1", 0, 4 / 3, 4 / 3),
        ("cornersPlus2", 0, 4 / 3, 4 / 3),
        ("boundaries", 0, 1, 4 / 3),
        ("all", 0, 1, 1),
    ],
)
def test_face_varying_values_follow_their_rule(only_mesh, rule, corner, edge, middle):
    """Connected values 0, 1, 4 along x: in the limit of cubic splines (0 + 4 · 1 + 4) / 6 at x = 1
    and, where the corner is smooth, (4 · 0 + 1 + 0) / 6 there; what is sharp stays. The corners of
    the points are smooth, and so at (1, 1) / 6."""
    cells = [(0, 0), (1, 0), (0, 1), (1, 1)]
    points = [(x, y) for y in (0, 1, 2) for x in (0, 1, 2)]
    around = [(0, 0), (1, 0), (1, 1), (0, 1)]
    indices = [points.index((x + u, y + v)) for x, y in cells for u, v in around]
    body = PRIMVAR.format(
        cage=SHEET,
        rule=rule,
        values="[" + ", ".join(f"({x * x}, 0, 0)" for x, _ in points) + "]",
        interpolation="faceVarying",
    ).replace(
        "}",
        f"""\n int[] primvars:displayColor:indices = {indices}
        token interpolateBoundary = "edgeOnly" }}""",
    )
    mesh = only_mesh(body, complexity="high")
    places = mesh.points[mesh.triangles]
    found = at_corners(mesh.primvars["displayColor"], mesh)[..., 0]
    for place, expected in (((1 / 6, 1 / 6), corner), ((1, 0), edge), ((1, 1), middle)):
        there = np.linalg.norm(places[..., :2] - place, axis=-1) < 1e-6
        assert there.any()
        assert found[there] == pytest.approx(expected, abs=1e-6)


def test_face_varying_values_of_unconnected_faces_stay_within_them(only_mesh):
    """Every face has its own corners: sharp, as cornersPlus1 says, so each spans all of 0 to 1."""
    body = PRIMVAR.format(
        cage=SHEET,
        rule="cornersPlus1",
        values="[" + ", ".join(["(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)"] * 4) + "]",
        interpolation="faceVarying",
    )
    mesh = only_mesh(body, complexity="high")
    values = at_corners(mesh.primvars["displayColor"], mesh)
    steps = np.round(values[..., :2] * 4, 5)
    assert np.isin(steps, range(5)).all()
    # Over every triangle they vary by one step: there is no jump inside.
    assert np.ptp(steps, axis=1).max() == 1


def test_subsets_bind_whole_faces(read):
    scene = read(
        f"""def Material "Red" {{
            token outputs:surface.connect = </Red/s.outputs:surface>
            def Shader "s" {{
                uniform token info:id = "UsdPreviewSurface"
                token outputs:surface
            }} }}
        def Mesh "m" {{ {CUBE}
            def GeomSubset "top" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
                uniform token elementType = "face"
                uniform token familyName = "materialBind"
                int[] indices = [1]
                rel material:binding = </Red>
            }} }}""",
        complexity="high",
    )
    mesh = scene.meshes[0]
    red = np.array([scene.materials[index].name == "/Red" for index in mesh.materials])
    assert red.sum() == len(red) / 6
    assert (face_normals(mesh)[red][:, 2] > 0.5).all()


# ---------------------------------------------------------------------------------------------
# Broken content


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("int[] creaseIndices = [0, 1]\nint[] creaseLengths = [3]", "creases"),
        (
            "int[] creaseIndices = [0, 1]\nint[] creaseLengths = [2]\n"
            "float[] creaseSharpnesses = [1, 2, 3]",
            "creases",
        ),
        ("int[] cornerIndices = [0, 1]\nfloat[] cornerSharpnesses = [1]", "corners"),
        (
            "int[] creaseIndices = [0, 7]\nint[] creaseLengths = [2]\n"
            "float[] creaseSharpnesses = [1]",
            "no edge",
        ),
    ],
)
def test_sharpness_that_does_not_fit_is_ignored_with_a_warning(examine, content, says):
    found = examine(f'def Mesh "m" {{ {CUBE} {content} }}', complexity="low")
    assert [w.paths for w in found.warnings if says in w.kind] == [["/m"]]


@pytest.mark.parametrize("name", ["creaseIndices", "cornerIndices", "holeIndices"])
def test_indices_out_of_range_name_the_mesh(read, name):
    extra = "int[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1]"
    if name == "cornerIndices":
        extra = "float[] cornerSharpnesses = [1, 1]"
    with pytest.raises(Error, match="/m"):
        read(f'def Mesh "m" {{ {CUBE} int[] {name} = [0, 8]\n{extra} }}')


def test_odd_topology_is_subdivided_without_harm(only_mesh):
    """An edge with three faces, faces turned against each other, a face on one vertex twice, a
    pentagon, a vertex of two separate fans and one without faces."""
    mesh = only_mesh(
        """def Mesh "m" {
        int[] faceVertexCounts = [4, 4, 4, 3, 5, 2, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 4, 5, 1, 0, 6, 7, 2, 2, 3,
                                   3, 8, 9, 10, 11, 0, 1, 2, 12, 13]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 0, 1), (0, 0, 1),
            (0, -1, 0), (1, -1, 0), (-1, 1, 0), (-1, 2, 0), (0, 3, 0), (1, 2, 0), (2, 1, 0),
            (2, 2, 0), (9, 9, 9)] }""",
        complexity="high",
    )
    assert len(mesh.triangles) == 2 * 4 * (3 * 4 + 5 + 3)
    assert np.isfinite(mesh.points).all()
    assert np.linalg.norm(mesh.normals.values, axis=1) == pytest.approx(
        np.ones(len(mesh.normals.values)), abs=1e-5
    )


def test_very_many_large_surfaces_are_coarser(monkeypatch, read):
    """Each may take an eighth of what is left of the triangles for all."""
    monkeypatch.setattr("usdmlt.stage.detail.BUDGET", 100_000)
    body = "".join(f'def Mesh "m{i}" {{ {CUBE} }}\n' for i in range(30))
    numbers = [len(mesh.triangles) for mesh in read(body).meshes]
    assert numbers == sorted(numbers, reverse=True)
    assert 1_000 < numbers[0] <= 12_500
    assert sum(numbers) <= 100_000
