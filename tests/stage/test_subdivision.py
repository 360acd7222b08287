"""Subdivision rules: limit surfaces against closed forms, splines and their own refinement."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from usdmlt.native import surfaces
from usdmlt.stage.subdivided import BILINEAR, CATMULL_CLARK, LOOP

CORE = surfaces()
INFINITE, Cage, refine = CORE.INFINITE, CORE.Cage, CORE.refine
limit_normals, limit_positions = CORE.limit_normals, CORE.limit_positions
find_sectors, face_varying_cage = CORE.find_sectors, CORE.face_varying_cage

CUBE = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
CUBE_FACES = np.array(
    [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5], dtype=np.int64
)


def cube() -> Cage:
    return Cage(np.full(6, 4), CUBE_FACES, 8)


def grid(cells: int) -> tuple[Cage, np.ndarray]:
    """A square of cells x cells quadrilaterals, and the (x, y) of its vertices."""
    row, column = np.mgrid[0:cells, 0:cells].reshape(2, -1)
    a = row * (cells + 1) + column
    quads = np.stack([a, a + 1, a + cells + 2, a + cells + 1], axis=1)
    y, x = np.mgrid[0 : cells + 1, 0 : cells + 1]
    places = np.stack([x, y], axis=-1).reshape(-1, 2).astype(float)
    return Cage(np.full(cells**2, 4), quads.ravel(), len(places)), places


def fan(scheme: str, faces: int, closed: bool) -> tuple[Cage, np.ndarray]:
    """``faces`` around vertex 0, and, after one refinement, where its neighbourhood went: vertex 0,
    then the ends of its edges, then the opposite corners, all counter-clockwise."""
    edges = faces if closed else faces + 1
    ahead, behind = 1 + np.arange(faces), 1 + (1 + np.arange(faces)) % edges
    sides = [np.zeros(faces, int), ahead, behind]
    if scheme != LOOP:
        sides.insert(2, 1 + edges + np.arange(faces))
    polygons = np.stack(sides, axis=1)
    cage = Cage(np.full(faces, len(sides)), polygons.ravel(), polygons.max() + 1)
    at_center = np.flatnonzero(cage.corner_vertices == 0)
    finer = [np.zeros(1, int), cage.vertex_count + cage.corner_edges[at_center]]
    if not closed:
        last = cage.corner_edges[cage.preceding[at_center[-1]]]
        finer.append(np.array([cage.vertex_count + last]))
    if scheme != LOOP:
        finer.append(cage.vertex_count + cage.edge_count + np.arange(faces))
    return cage, np.concatenate(finer)


def sharpen(cage: Cage, chain: list[int], sharpness: float) -> None:
    for a, b in pairwise(chain):
        edge = (np.sort(cage.edge_vertices, axis=1) == sorted((a, b))).all(axis=1)
        assert edge.any()
        cage.edge_sharpness[edge] = sharpness


def refined(cage: Cage, scheme: str, values: np.ndarray, levels: int) -> tuple[Cage, np.ndarray]:
    for _ in range(levels):
        cage, step = refine(cage, scheme)
        values = step(values)
    return cage, values


# ---------------------------------------------------------------------------------------------
# Catmull–Clark


def test_a_cubes_corners_go_where_the_closed_form_says():
    """Limit mask of valence 3: (9 V + 4 sum E + sum F) / 24 = (3/4, 3/4, 3/4) for V = (1, 1, 1)."""
    limit = limit_positions(cube(), CATMULL_CLARK)(CUBE)
    assert limit[7] == pytest.approx([0.75, 0.75, 0.75])
    for level in (1, 2, 3):
        cage, values = refined(cube(), CATMULL_CLARK, CUBE, level)
        assert limit_positions(cage, CATMULL_CLARK)(values)[7] == pytest.approx(limit[7])


def test_one_refinement_of_a_cube_has_the_points_of_the_rules():
    """Face points at the centres, edge points (3/4 of the way out) and vertex points at 7/9."""
    _, values = refined(cube(), CATMULL_CLARK, CUBE - 0.5, 1)
    assert np.sort(np.abs(values[:8]).ravel()) == pytest.approx(np.full(24, 5 / 18))
    assert np.linalg.norm(values[8:20], axis=1) == pytest.approx(np.full(12, np.sqrt(2) * 3 / 8))
    assert np.linalg.norm(values[20:], axis=1) == pytest.approx(np.full(6, 0.5))


def test_a_regular_grid_is_the_bicubic_spline():
    """Its control values x² y stand for the polynomial (x² + 1/3) y: the mean square of a cubic
    B-spline's knots is 1/3. Polynomials up to cubics are reproduced exactly."""
    cage, place = grid(8)
    values = (place[:, 0] ** 2 * place[:, 1])[:, None]
    cage, values = refined(cage, CATMULL_CLARK, np.column_stack([place, values]), 3)
    limit = limit_positions(cage, CATMULL_CLARK)(values)
    x, y, z = limit[((limit[:, :2] > 2) & (limit[:, :2] < 6)).all(axis=1)].T
    assert len(x) > 500
    assert z == pytest.approx((x**2 + 1 / 3) * y, abs=1e-12)


def test_normals_of_a_regular_grid_are_those_of_the_spline():
    cage, place = grid(8)
    points = np.column_stack([place, 0.1 * place[:, 0] ** 2 * place[:, 1]])
    cage, values = refined(cage, CATMULL_CLARK, points, 2)
    limit = limit_positions(cage, CATMULL_CLARK)(values)
    normals, sector = limit_normals(cage, CATMULL_CLARK, values, limit)
    x, y, _ = limit[cage.corner_vertices].T
    inside = (np.minimum(x, y) > 2) & (np.maximum(x, y) < 6)
    expected = np.stack([-0.2 * x * y, -0.1 * (x**2 + 1 / 3), np.ones_like(x)], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert normals[sector][inside] == pytest.approx(expected[inside], abs=1e-12)


@pytest.mark.parametrize("boundary", [True, False])
def test_creases_and_boundaries_are_cubic_splines(boundary):
    """A straight row of control points x with heights x² is the curve z = x² + 1/3."""
    cage, place = grid(8)
    rng = np.random.default_rng(3)
    points = np.column_stack([place, rng.normal(size=len(place))])
    row = np.arange(9) if boundary else 4 * 9 + np.arange(9)
    points[row, 2] = place[row, 0] ** 2
    if not boundary:
        sharpen(cage, row.tolist(), INFINITE)
    cage, values = refined(cage, CATMULL_CLARK, points, 4)
    limit = limit_positions(cage, CATMULL_CLARK)(values)
    on_curve = (np.abs(limit[:, 1] - (0 if boundary else 4)) < 1e-9) & (np.abs(limit[:, 0] - 4) < 2)
    x, z = limit[on_curve][:, 0], limit[on_curve][:, 2]
    assert len(x) > 50
    assert z == pytest.approx(x**2 + 1 / 3, abs=1e-12)


def test_semi_sharp_creases_lie_between_smooth_and_sharp_ones():
    """A bump over a crease falls short of the control points by less the sharper the crease is."""
    heights = []
    for sharpness in (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, INFINITE):
        cage, place = grid(8)
        points = np.column_stack([place, np.abs(place[:, 1] - 4)])
        sharpen(cage, (4 * 9 + np.arange(9)).tolist(), sharpness)
        cage, values = refined(cage, CATMULL_CLARK, points, 4)
        limit = limit_positions(cage, CATMULL_CLARK)(values)
        heights.append(limit[4 * 9 + 4, 2])
    assert heights[0] == pytest.approx(1 / 3)  # 1/6 of both neighbours' heights
    assert heights[2] == pytest.approx(1 / 6)  # sharp once: half as wide a spline
    assert heights[4] == pytest.approx(1 / 12)
    assert heights[1] == pytest.approx((heights[0] + heights[2]) / 2)  # the rules are blended
    assert heights[-1] == pytest.approx(0)
    assert (np.diff(heights) < 0).all()


def test_sharp_corners_stay_where_they_are():
    cage = cube()
    cage.vertex_sharpness[7] = INFINITE
    cage, values = refined(cage, CATMULL_CLARK, CUBE, 3)
    assert limit_positions(cage, CATMULL_CLARK)(values)[7].tolist() == [1, 1, 1]


def test_smooth_triangles_shift_edge_points():
    """Between two triangles: 0.47 of both face points, 0.03 of the ends instead of a quarter."""
    cage = Cage(np.array([3, 3]), np.array([0, 1, 2, 0, 2, 3]), 4)
    edge = np.flatnonzero(cage.edge_sharpness == 0)
    _, step = refine(cage, CATMULL_CLARK, smooth_triangles=True)
    weights = step(np.eye(4))[cage.vertex_count + edge[0]]
    inner = 0.03 + 2 * 0.47 / 3
    assert weights == pytest.approx([inner, 0.47 / 3, inner, 0.47 / 3])


# ---------------------------------------------------------------------------------------------
# Loop and bilinear


def test_loops_limit_of_a_tetrahedron():
    """Valence 3: beta = 3/16, so V / 3 + ... : limit = (2 V + sum E) / 5."""
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
    cage = Cage(np.full(4, 3), np.array([0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]), 4)
    limit = limit_positions(cage, LOOP)(points)
    assert limit[0] == pytest.approx([0.2, 0.2, 0.2])
    finer, values = refined(cage, LOOP, points, 3)
    assert limit_positions(finer, LOOP)(values)[:4] == pytest.approx(limit)


def test_a_regular_triangle_mesh_reproduces_quadratics():
    """Loop's scheme on valence 6 is the quartic box spline: heights x² become x² plus a constant,
    the same everywhere."""
    n = 9
    row, column = np.mgrid[0 : n - 1, 0 : n - 1].reshape(2, -1)
    a = row * n + column
    triangles = np.concatenate(
        [np.stack([a, a + 1, a + n], axis=1), np.stack([a + 1, a + n + 1, a + n], axis=1)]
    )
    y, x = np.mgrid[0:n, 0:n].reshape(2, -1).astype(float)
    points = np.stack([x + y / 2, y * np.sqrt(3) / 2, (x + y / 2) ** 2], axis=1)
    cage = Cage(np.full(len(triangles), 3), triangles.ravel(), n * n)
    inside = ((x > 2) & (x < 6) & (y > 2) & (y < 6)).nonzero()[0]
    center = points[inside].mean(axis=0)
    cage, values = refined(cage, LOOP, points, 2)
    limit = limit_positions(cage, LOOP)(values)
    near = np.linalg.norm(limit[:, :2] - center[:2], axis=1) < 1
    extra = limit[near, 2] - limit[near, 0] ** 2
    assert near.sum() > 30
    assert np.ptp(extra) == pytest.approx(0, abs=1e-12)
    assert extra[0] > 0.1


def test_bilinear_refinement_stays_on_the_patches():
    cage = Cage(np.array([4]), np.arange(4), 4)
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 0)], dtype=float)
    _, values = refined(cage, BILINEAR, points, 3)
    assert values[:, 2] == pytest.approx(values[:, 0] * values[:, 1])


# ---------------------------------------------------------------------------------------------
# Limit masks are eigenvectors of the subdivision matrix


@pytest.mark.parametrize("scheme", [CATMULL_CLARK, LOOP])
@pytest.mark.parametrize(
    ("faces", "closed"),
    [(n, False) for n in (1, 2, 3, 4, 5, 6, 9)] + [(n, True) for n in (3, 4, 5, 6, 9)],
)
def test_limit_masks_are_left_eigenvectors(scheme, closed, faces):
    """l S = l, and t S = lambda t for both tangents, with S the map of a vertex's neighbourhood
    onto its refined self; the tangents' eigenvalues are the largest of their symmetry."""
    cage, finer = fan(scheme, faces, closed)
    _, step = refine(cage, scheme)
    matrix = step(np.eye(cage.vertex_count))[finer]
    limit = limit_positions(cage, scheme)(np.eye(cage.vertex_count))[0]
    assert limit @ matrix == pytest.approx(limit, abs=1e-14)
    assert limit.sum() == pytest.approx(1)

    sector = find_sectors(cage)[0][np.flatnonzero(cage.corner_vertices == 0)[0]]
    eigenvalues = np.sort(np.abs(np.linalg.eigvals(matrix)))[::-1]
    for tangent in CORE.sector_tangents(cage, scheme):
        mask = tangent(np.eye(cage.vertex_count))[sector]
        mapped = mask @ matrix
        eigenvalue = mapped @ mask / (mask @ mask)
        assert mapped == pytest.approx(eigenvalue * mask, abs=1e-13 * np.abs(mask).max())
        assert mask.sum() == pytest.approx(0, abs=1e-12)
        if closed or faces < 4:  # with more, standard rules let other modes be as large
            assert eigenvalues[1] * 0.49 < eigenvalue <= eigenvalues[1] + 1e-12


def test_normals_are_apart_across_creases_and_one_at_darts():
    cage, _ = grid(4)
    sharpen(cage, [10, 11, 12, 13], INFINITE)  # from the boundary to 13, inside the sheet
    sector, _, _, closed = find_sectors(cage)
    around = [np.unique(sector[cage.corner_vertices == v]).size for v in (11, 12, 13, 7)]
    assert around == [2, 2, 1, 1]
    assert closed[sector[cage.corner_vertices == 13]].all()


# ---------------------------------------------------------------------------------------------
# Face-varying values


@pytest.mark.parametrize(
    ("rule", "corners"),
    [
        ("none", []),
        # On the seam (2, 7, 12, 17, 22) only its ends have values with one face.
        ("cornersOnly", [0, 2, 4, 20, 22, 24]),
        ("cornersPlus1", [0, 2, 4, 20, 22, 24]),
        ("cornersPlus2", [0, 2, 4, 20, 22, 24]),
        ("boundaries", [0, 1, 2, 3, 4, 5, 7, 9, 10, 12, 14, 15, 17, 19, 20, 21, 22, 23, 24]),
    ],
)
def test_which_values_along_a_straight_seam_are_corners(rule, corners):
    """The right half of a sheet of 4 x 4 cells has values of its own."""
    cage, _ = grid(4)
    values = cage.corner_vertices + 25 * (cage.corner_faces % 4 >= 2)
    own, chosen = face_varying_cage(cage, np.full(16, 4), values, rule)
    # Seams have two sides, with two values at the ends: quadrilaterals' corners are single ones.
    assert sorted(set((chosen % 25)[own.vertex_sharpness > 0].tolist())) == corners


def test_where_more_than_two_values_meet_they_are_corners_from_plus_1_on():
    """Vertex 12 has three regions: the lower half and two upper quarters."""
    cage, _ = grid(4)
    row, column = cage.corner_faces // 4, cage.corner_faces % 4
    values = cage.corner_vertices + 25 * np.where(row < 2, 0, np.where(column < 2, 1, 2))
    sharp = {}
    for rule in ("cornersOnly", "cornersPlus1", "cornersPlus2"):
        own, chosen = face_varying_cage(cage, np.full(16, 4), values, rule)
        sharp[rule] = (own.vertex_sharpness > 0)[chosen % 25 == 12].tolist()
    # Alone, the two quarters are corners of one face, the half with two faces is not.
    assert sorted(sharp["cornersOnly"]) == [False, True, True]
    assert sharp["cornersPlus1"] == sharp["cornersPlus2"] == [True, True, True]


def test_the_other_side_of_a_corner_and_darts_are_corners_with_plus_2_only():
    cage, _ = grid(4)
    quarter = (cage.corner_faces // 4 >= 2) & (cage.corner_faces % 4 >= 2)
    concave = cage.corner_vertices + 25 * quarter
    # A slit from the middle (12) to the top: only its inner end has one value.
    slit = cage.corner_vertices + 25 * (
        (cage.corner_faces % 4 >= 2) & np.isin(cage.corner_vertices, (17, 22))
    )
    found = {}
    for rule in ("cornersOnly", "cornersPlus1", "cornersPlus2"):
        for name, values in (("concave", concave), ("dart", slit)):
            own, chosen = face_varying_cage(cage, np.full(16, 4), values, rule)
            found[rule, name] = (own.vertex_sharpness > 0)[chosen % 25 == 12].tolist()
    assert sorted(found["cornersOnly", "concave"]) == [False, True]
    assert sorted(found["cornersPlus1", "concave"]) == [False, True]
    assert found["cornersPlus2", "concave"] == [True, True]
    assert found["cornersPlus1", "dart"] == [False]
    assert found["cornersPlus2", "dart"] == [True]
