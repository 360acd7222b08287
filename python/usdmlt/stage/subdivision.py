"""Uniform refinement of subdivision surfaces: Catmull–Clark, Loop and bilinear.

A :class:`Cage` is refined once by :func:`refine`, which gives the finer cage and the
:class:`Stencils` that compute its vertices from the coarser ones. Stencils depend on the topology
only: they serve points, primvars and face-varying values alike.

Sharpness follows Hoppe et al. (1994) and DeRose, Kass and Truong (1998): it falls by one with each
refinement, and between 0 and 1 the sharp and the smooth rule are blended.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CATMULL_CLARK, LOOP, BILINEAR = "catmullClark", "loop", "bilinear"
INFINITE = 10.0  # sharpness from which on an edge stays sharp, as UsdGeomMesh and OpenSubdiv say
SMOOTH_TRIANGLE = 0.47  # a triangle's share of an edge point, where quadrilaterals have 0.25


@dataclass
class Cage:
    """Polygons as corners (positions in ``faceVertexIndices``), and their edges.

    Corner c of face ``corner_faces[c]`` is at vertex ``corner_vertices[c]``; ``following[c]`` and
    ``preceding[c]`` are its neighbours in the face; ``corner_edges[c]`` is the edge to the
    following one. ``edge_vertices`` (edges, 2); sharpness per edge and vertex, infinite on
    boundaries.
    """

    vertex_count: int
    face_count: int
    corner_vertices: np.ndarray
    corner_faces: np.ndarray
    following: np.ndarray
    preceding: np.ndarray
    corner_edges: np.ndarray
    edge_vertices: np.ndarray
    edge_sharpness: np.ndarray
    vertex_sharpness: np.ndarray

    @property
    def corner_count(self) -> int:
        return len(self.corner_vertices)

    @property
    def edge_count(self) -> int:
        return len(self.edge_vertices)


def build_cage(counts: np.ndarray, indices: np.ndarray, vertex_count: int) -> Cage:
    """The cage of polygons, as UsdGeomMesh lists them; sharp where an edge has other than two faces
    or where its two are turned against each other. ``counts`` are at least 3."""
    corners = np.arange(len(indices))
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    sides = np.repeat(counts, counts)
    following = starts + (corners - starts + 1) % sides
    preceding = starts + (corners - starts - 1) % sides
    indices = indices.astype(np.int64)
    tail, head = indices, indices[following]
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    keys, edges = np.unique(low * vertex_count + high, return_inverse=True)
    edges = edges.ravel()
    uses = np.bincount(edges, minlength=len(keys))
    turns = np.bincount(edges, np.where(tail < head, 1, -1), minlength=len(keys))
    return Cage(
        vertex_count=vertex_count,
        face_count=len(counts),
        corner_vertices=indices,
        corner_faces=np.repeat(np.arange(len(counts)), counts),
        following=following,
        preceding=preceding,
        corner_edges=edges,
        edge_vertices=np.stack([keys // vertex_count, keys % vertex_count], axis=1),
        edge_sharpness=np.where((uses == 2) & (turns == 0), 0.0, INFINITE),
        vertex_sharpness=np.zeros(vertex_count),
    )


class Stencils:
    """Weighted sums of rows of an array: a sparse matrix by its entries, in any order."""

    def __init__(self, count: int):
        self.count = count
        self._entries: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def add(self, rows: np.ndarray, columns: np.ndarray, weights: np.ndarray | float) -> None:
        """Add ``weights`` times row ``columns`` to row ``rows``; all broadcast."""
        weights = np.asarray(weights, dtype=np.float64)
        if weights.ndim and not weights.all():
            used = weights != 0
            rows, columns, weights = rows[used], columns[used], weights[used]
        self._entries.append((rows, columns, weights))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(count, width) float64 from ``values`` (n, width)."""
        result = np.zeros((self.count, values.shape[1]))
        for axis in range(values.shape[1]):
            column = np.ascontiguousarray(values[:, axis], dtype=np.float64)
            for rows, columns, weights in self._entries:
                result[:, axis] += np.bincount(rows, weights * column[columns], self.count)
        return result


class Refinement:
    """The vertices of a finer cage from those of a coarser one: first those in the middle of faces,
    which the others are made from."""

    def __init__(self, faces: Stencils, others: Stencils):
        self.faces = faces
        self.others = others

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(finer vertices, width) float64 from (coarser vertices, width)."""
        faces = self.faces(values)
        return np.concatenate([self.others(np.concatenate([values, faces])), faces])


# ---------------------------------------------------------------------------------------------
# Which rule a vertex has


@dataclass
class VertexRules:
    """Shares of the smooth, crease and corner rules, (vertices,) each, adding up to 1, and the
    ends of edges (edges, 2) that a crease runs through."""

    smooth: np.ndarray
    crease: np.ndarray
    corner: np.ndarray
    crease_ends: np.ndarray


def weakened(sharpness: np.ndarray) -> np.ndarray:
    """Sharpness one level on."""
    return np.where(sharpness >= INFINITE, sharpness, np.maximum(sharpness - 1, 0))


def sharp_ends(cage: Cage, sharpness: np.ndarray) -> np.ndarray:
    """(vertices,) how many sharp edges each vertex has."""
    return np.bincount(
        cage.edge_vertices.ravel(), np.repeat(sharpness > 0, 2), minlength=cage.vertex_count
    )


def _rule(vertex_sharpness: np.ndarray, sharp_edges: np.ndarray) -> np.ndarray:
    """0 smooth (one sharp edge, a dart, included), 1 crease, 2 corner."""
    rule = np.where(sharp_edges < 2, 0, np.where(sharp_edges == 2, 1, 2))
    return np.where(vertex_sharpness > 0, 2, rule)


def vertex_rules(cage: Cage, blend: bool = True) -> VertexRules:
    """The rules of a cage's vertices. Where sharpness runs out with this refinement, the rules
    before and after are blended by the mean of what runs out (OpenSubdiv's Sdc::Crease)."""
    edge, vertex = cage.edge_sharpness, cage.vertex_sharpness
    edge_after, vertex_after = weakened(edge), weakened(vertex)
    before = _rule(vertex, sharp_ends(cage, edge))
    if not blend:
        edge_after, after, share = edge, before, np.ones(cage.vertex_count)
    else:
        after = _rule(vertex_after, sharp_ends(cage, edge_after))
        fading = (edge > 0) & (edge_after == 0)
        ends = cage.edge_vertices[fading].ravel()
        total = np.bincount(ends, np.repeat(edge[fading], 2), minlength=cage.vertex_count)
        number = np.bincount(ends, minlength=cage.vertex_count)
        fading = (vertex > 0) & (vertex_after == 0)
        total, number = total + np.where(fading, vertex, 0), number + fading
        share = np.minimum(np.divide(total, number, out=np.zeros_like(total), where=number > 0), 1)
        share = np.where(before == after, 1.0, share)

    def mixed(rule: int) -> np.ndarray:
        return share * (before == rule) + (1 - share) * (after == rule)

    through_before = (before == 1)[cage.edge_vertices] & (edge > 0)[:, None]
    through_after = ((before != 1) & (after == 1))[cage.edge_vertices] & (edge_after > 0)[:, None]
    isolated = np.bincount(cage.edge_vertices.ravel(), minlength=cage.vertex_count) == 0
    return VertexRules(
        smooth=np.where(isolated, 0.0, mixed(0)),
        crease=mixed(1),
        corner=np.where(isolated, 1.0, mixed(2)),
        crease_ends=through_before | through_after,
    )


def valences(cage: Cage) -> np.ndarray:
    """(vertices,) edges at each, at least 1."""
    return np.maximum(np.bincount(cage.edge_vertices.ravel(), minlength=cage.vertex_count), 1)


# ---------------------------------------------------------------------------------------------
# Refinement


def refine(cage: Cage, scheme: str, smooth_triangles: bool = False) -> tuple[Cage, Refinement]:
    """One level: every face into one quadrilateral per corner, or, by Loop's scheme, every triangle
    into four. The vertices are those of vertices, then of edges, then of faces."""
    if scheme == LOOP:
        return _split_triangles(cage), _loop(cage)
    if scheme == BILINEAR:
        return _split_polygons(cage), bilinear(cage)
    return _split_polygons(cage), _catmull_clark(cage, smooth_triangles)


def _finer(cage: Cage, **topology: np.ndarray | int) -> Cage:
    """A refined cage: its first edges are the halves of the coarser ones, in pairs; those within
    faces are smooth."""
    inner = len(topology["edge_vertices"]) - 2 * cage.edge_count
    halves = np.repeat(weakened(cage.edge_sharpness), 2)
    new = topology["vertex_count"] - cage.vertex_count
    return Cage(
        edge_sharpness=np.concatenate([halves, np.zeros(inner)]),
        vertex_sharpness=np.concatenate([weakened(cage.vertex_sharpness), np.zeros(new)]),
        **topology,
    )


def _half(cage: Cage, corners: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """The half of each corner's edge that ends at the corner's vertex."""
    return 2 * edges + (cage.edge_vertices[edges, 0] != cage.corner_vertices[corners])


def _halves(cage: Cage) -> np.ndarray:
    """(2 edges, 2): the vertices of the halves of edges."""
    middle = cage.vertex_count + np.arange(cage.edge_count)
    return np.stack([cage.edge_vertices.ravel(), np.repeat(middle, 2)], axis=1)


def _split_polygons(cage: Cage) -> Cage:
    v, e, c = cage.vertex_count, cage.edge_count, cage.corner_count
    corners = np.arange(c)
    before = cage.corner_edges[cage.preceding]
    middles = v + cage.corner_edges
    centers = v + e + cage.corner_faces
    quads = [cage.corner_vertices, middles, centers, v + before]
    edges = [
        _half(cage, corners, cage.corner_edges),
        2 * e + corners,
        2 * e + cage.preceding,
        _half(cage, corners, before),
    ]
    finer = np.arange(4 * c).reshape(-1, 4)
    return _finer(
        cage,
        vertex_count=v + e + cage.face_count,
        face_count=c,
        corner_vertices=np.stack(quads, axis=1).ravel(),
        corner_faces=np.repeat(corners, 4),
        following=finer[:, (1, 2, 3, 0)].ravel(),
        preceding=finer[:, (3, 0, 1, 2)].ravel(),
        corner_edges=np.stack(edges, axis=1).ravel(),
        edge_vertices=np.concatenate([_halves(cage), np.stack([middles, centers], axis=1)]),
    )


def _split_triangles(cage: Cage) -> Cage:
    v, e, c = cage.vertex_count, cage.edge_count, cage.corner_count
    corners = np.arange(c)
    middles, before = v + cage.corner_edges, cage.corner_edges[cage.preceding]
    at_corners = np.stack([cage.corner_vertices, middles, v + before], axis=1).reshape(-1, 3, 3)
    outer = np.stack(
        [
            _half(cage, corners, cage.corner_edges),
            2 * e + corners,
            _half(cage, corners, before),
        ],
        axis=1,
    ).reshape(-1, 3, 3)
    inside = middles.reshape(-1, 1, 3)
    inner = (2 * e + cage.following).reshape(-1, 1, 3)
    finer = np.arange(4 * c).reshape(-1, 3)
    return _finer(
        cage,
        vertex_count=v + e,
        face_count=4 * cage.face_count,
        corner_vertices=np.concatenate([at_corners, inside], axis=1).ravel(),
        corner_faces=np.repeat(np.arange(4 * cage.face_count), 3),
        following=finer[:, (1, 2, 0)].ravel(),
        preceding=finer[:, (2, 0, 1)].ravel(),
        corner_edges=np.concatenate([outer, inner], axis=1).ravel(),
        edge_vertices=np.concatenate([_halves(cage), np.stack([middles, v + before], axis=1)]),
    )


def _face_centers(cage: Cage) -> Stencils:
    faces = Stencils(cage.face_count)
    sides = np.bincount(cage.corner_faces, minlength=cage.face_count)
    faces.add(cage.corner_faces, cage.corner_vertices, 1.0 / sides[cage.corner_faces])
    return faces


def bilinear(cage: Cage) -> Refinement:
    """Linear interpolation: vertices stay, edges are halved, faces get their mean."""
    others = Stencils(cage.vertex_count + cage.edge_count)
    vertices, edges = np.arange(cage.vertex_count), np.arange(cage.edge_count)
    others.add(vertices, vertices, 1.0)
    for end in (0, 1):
        others.add(cage.vertex_count + edges, cage.edge_vertices[:, end], 0.5)
    return Refinement(_face_centers(cage), others)


def _catmull_clark(cage: Cage, smooth_triangles: bool) -> Refinement:
    """Catmull and Clark (1978): of a vertex V of n edges, with the far ends E and the new face
    points F, V' = (n - 2)/n V + (sum E + sum F) / n²; an edge point is the mean of its ends and
    the adjacent face points. Beside triangles "smooth" shifts it towards them (Stam and Loop).
    """
    v, e = cage.vertex_count, cage.edge_count
    others, edges = Stencils(v + e), v + np.arange(e)
    sharp = np.minimum(cage.edge_sharpness, 1.0)
    face_share = np.full(e, 0.25)
    if smooth_triangles:
        sides = np.bincount(cage.corner_faces)[cage.corner_faces]
        of_faces = np.where(sides == 3, SMOOTH_TRIANGLE, 0.25)
        face_share = np.bincount(cage.corner_edges, of_faces, minlength=e) / 2
    at_ends = 0.5 * sharp + (1 - sharp) * (0.5 - face_share)
    for end in (0, 1):
        others.add(edges, cage.edge_vertices[:, end], at_ends)
    at_faces = ((1 - sharp) * face_share)[cage.corner_edges]
    others.add(v + cage.corner_edges, v + cage.corner_faces, at_faces)

    n = valences(cage).astype(np.float64)
    rules = vertex_rules(cage)
    _add_vertices(cage, others, rules, (n - 2) / n, 1 / n**2)
    at_faces = (rules.smooth / n**2)[cage.corner_vertices]
    others.add(cage.corner_vertices, v + cage.corner_faces, at_faces)
    return Refinement(_face_centers(cage), others)


def _loop(cage: Cage) -> Refinement:
    """Loop (1987): edge points are 3/8 of the ends and 1/8 of the opposite vertices; a vertex keeps
    1 - n beta and takes beta of each of its n neighbours."""
    v, e = cage.vertex_count, cage.edge_count
    others, edges = Stencils(v + e), v + np.arange(e)
    sharp = np.minimum(cage.edge_sharpness, 1.0)
    for end in (0, 1):
        others.add(edges, cage.edge_vertices[:, end], 0.5 * sharp + 0.375 * (1 - sharp))
    opposite = cage.corner_vertices[cage.preceding]
    others.add(v + cage.corner_edges, opposite, 0.125 * (1 - sharp)[cage.corner_edges])
    n = valences(cage)
    beta = loop_beta(n)
    _add_vertices(cage, others, vertex_rules(cage), 1 - n * beta, beta)
    return Refinement(Stencils(0), others)


def loop_beta(n: np.ndarray) -> np.ndarray:
    """Loop's weight of each of n neighbours: (5/8 - (3/8 + cos(2 pi / n) / 4)²) / n."""
    return (0.625 - (0.375 + 0.25 * np.cos(2 * np.pi / n)) ** 2) / n


def _add_vertices(
    cage: Cage,
    others: Stencils,
    rules: VertexRules,
    smooth_center: np.ndarray,
    smooth_neighbor: np.ndarray,
) -> None:
    """The points of vertices, face points aside: along creases the cubic B-spline's 1/8, 6/8, 1/8;
    corners stay."""
    vertices = np.arange(cage.vertex_count)
    center = rules.smooth * smooth_center + rules.crease * 0.75 + rules.corner
    others.add(vertices, vertices, center)
    neighbor = rules.smooth * smooth_neighbor
    for end in (0, 1):
        near, far = cage.edge_vertices[:, end], cage.edge_vertices[:, 1 - end]
        through = rules.crease[near] * 0.125 * rules.crease_ends[:, end]
        others.add(near, far, neighbor[near] + through)
