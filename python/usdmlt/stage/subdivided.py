"""Subdivision surfaces of meshes: the refined cage, and primvars of every interpolation on it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from pxr import UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.native import surfaces
from usdmlt.scene import Mesh, Primvar
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.detail import Detail
from usdmlt.stage.primvars import fits

CATMULL_CLARK, LOOP, BILINEAR = SCHEMES = ("catmullClark", "loop", "bilinear")


class Subdivided:
    """A subdivision surface: what was authored, and its triangles at one level of refinement.

    Stands where a :class:`~usdmlt.stage.primvars.Topology` does for polygons: ``vertices``
    (triangles, 3) of the refined points, ``faces`` (triangles,) the authored face of each.
    """

    def __init__(
        self,
        mesh: Attributes,
        counts: np.ndarray,
        indices: np.ndarray,
        points: np.ndarray,
        report: Report,
    ):
        self.path = mesh.prim.GetPath()
        self.scheme = str(mesh["subdivisionScheme"])
        self.point_count, self.face_count = len(points), len(counts)
        self.corner_count = len(indices)
        self.left_handed = mesh["orientation"] == UsdGeom.Tokens.leftHanded
        self.rule = str(mesh["faceVaryingLinearInterpolation"])
        self.smooth_triangles = mesh["triangleSubdivisionRule"] == UsdGeom.Tokens.smooth

        # The corners and faces that take part, by their authored numbers.
        self.corners, self.owners, self.counts = self._usable(points, counts, indices, report)
        self.cage = surfaces().Cage(self.counts, indices[self.corners], len(points))
        read_sharpness(mesh, self.cage, report)
        boundary = str(mesh["interpolateBoundary"])
        self.hidden = self._hidden_faces(mesh, boundary)
        if boundary == UsdGeom.Tokens.edgeAndCorner:
            faces = np.bincount(self.cage.corner_vertices, minlength=self.cage.vertex_count)
            self.cage.vertex_sharpness[faces == 1] = surfaces().INFINITE

    def _usable(self, points, counts, indices, report) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Faces of at least three sides, none of them from a vertex to itself; triangles if the
        scheme asks for them."""
        split = None
        if self.scheme == LOOP and (counts != 3).any():
            report.warn("Loop's scheme is for triangles: other faces are split", self.path)
            split, faces = surfaces().triangulate(points, counts, indices)
            counts, indices = np.full(len(faces), 3, dtype=np.int32), indices[split.ravel()]
        corners, owners, sides = surfaces().usable_faces(counts, indices)
        if len(owners) < len(counts):
            report.note("faces without area are left out", self.path)
        if split is not None:
            corners, owners = split.ravel()[corners], faces[owners]
        return corners, owners, sides

    def _hidden_faces(self, mesh: Attributes, boundary: str) -> np.ndarray:
        """(cage faces,): holes, and, if boundaries are not interpolated, the faces beside them;
        empty for none."""
        holes = mesh.array("holeIndices", np.int64)
        if not len(holes) and boundary != UsdGeom.Tokens.none:
            return np.empty(0, dtype=bool)
        hidden = np.zeros(self.cage.face_count, dtype=bool)
        if len(holes):
            if not (holes.min() >= 0 and holes.max() < self.face_count):
                raise Error(f"{self.path}: holeIndices out of range (0 to {self.face_count - 1})")
            hidden |= np.isin(self.owners, holes)
        if boundary == UsdGeom.Tokens.none:
            uses = np.bincount(self.cage.corner_edges, minlength=self.cage.edge_count)
            beside = np.zeros(self.cage.vertex_count, dtype=bool)
            beside[self.cage.edge_vertices[uses < 2]] = True
            beside &= self.cage.vertex_sharpness < surfaces().INFINITE
            hidden[self.cage.corner_faces[beside[self.cage.corner_vertices]]] = True
        return hidden

    @property
    def regular(self) -> bool:
        """Whether the cage itself has the faces that refinement makes, and limit masks need."""
        return bool((self.counts == (3 if self.scheme == LOOP else 4)).all())

    def refine(self, level: int) -> None:
        """Make the triangles of a level."""
        self.level = level if self.regular else max(level, 1)
        self.cages, self.refinements = [self.cage], []
        for _ in range(self.level):
            finer, refinement = self._refined(self.cages[-1])
            self.cages.append(finer)
            self.refinements.append(refinement)
        triangles = self.cages[-1].triangles(self.left_handed, self.hidden)
        self.triangle_corners, self.vertices, cage_faces = triangles
        self.faces = self.owners[cage_faces]

    def _refined(self, cage):
        try:
            return surfaces().refine(cage, self.scheme, self.smooth_triangles)
        except ValueError as error:  # std::length_error
            raise Error(f"{self.path}: {error}") from None

    # -- values

    def smooth(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (cage vertices, width) at the refined vertices, and in the limit."""
        for refinement in self.refinements:
            values = refinement(values)
        return values, values if self.limit is None else self.limit(values)

    @cached_property
    def limit(self):
        if self.scheme == BILINEAR:
            return None
        return surfaces().limit_positions(self.cages[-1], self.scheme)

    def normals(self, refined: np.ndarray, limit: np.ndarray) -> Primvar:
        """Unit normals of the limit surface, apart on both sides of creases; of bilinear patches,
        apart at every corner."""
        finest = self.cages[-1]
        normals, index = surfaces().limit_normals(finest, self.scheme, refined, limit)
        if self.left_handed:
            normals = -normals
        corners = index[self.triangle_corners]
        return Primvar(normals.astype(np.float32), corners)

    def spread(
        self, values: np.ndarray, indices: np.ndarray | None, interpolation: str
    ) -> Primvar | None:
        """As :meth:`usdmlt.stage.primvars.Topology.spread`."""
        elements = {
            UsdGeom.Tokens.constant: 1,
            UsdGeom.Tokens.uniform: self.face_count,
            UsdGeom.Tokens.faceVarying: self.corner_count,
        }.get(interpolation, self.point_count)
        if not fits(values, indices, elements, interpolation):
            return None
        if interpolation == UsdGeom.Tokens.faceVarying:
            return self._face_varying(values, indices)
        if interpolation in (UsdGeom.Tokens.constant, UsdGeom.Tokens.uniform):
            element = self.faces if interpolation == UsdGeom.Tokens.uniform else 0 * self.faces
            if indices is not None:
                element = indices[element].astype(np.int32)
            return Primvar(values, np.repeat(element[:, None], 3, axis=1))
        if indices is not None:
            values = values[indices]
        if interpolation == UsdGeom.Tokens.varying:
            for cage in self.cages[:-1]:
                values = surfaces().linear_refinement(cage, self.scheme)(values)
        else:
            values = self.smooth(values)[1]
        return Primvar(values.astype(np.float32))

    def _face_varying(self, values: np.ndarray, indices: np.ndarray | None) -> Primvar:
        index = np.arange(self.corner_count) if indices is None else indices
        linear = self.scheme == BILINEAR or self.rule == UsdGeom.Tokens.all
        cage, chosen = surfaces().face_varying_cage(
            self.cage, self.counts, index[self.corners], self.rule
        )
        values = values[chosen]
        for _ in range(self.level):
            coarser = cage
            cage, step = self._refined(coarser)
            if linear:
                step = surfaces().linear_refinement(coarser, self.scheme)
            values = step(values)
        if not linear:
            values = surfaces().limit_positions(cage, self.scheme)(values)
        return Primvar(values.astype(np.float32), cage.corner_vertices[self.triangle_corners])


def read_sharpness(mesh: Attributes, cage, report: Report) -> None:
    """Creases and corners of a mesh into the sharpness of its cage."""
    path = mesh.prim.GetPath()
    corners = mesh.array("cornerIndices", np.int64)
    sharpness = mesh.array("cornerSharpnesses", np.float64)
    if len(corners) != len(sharpness):
        report.warn("corners whose number of sharpnesses does not fit are ignored", path)
    elif len(corners):
        _check_vertices(f"{path}.cornerIndices", corners, cage)
        _sharpen(cage.vertex_sharpness, corners, sharpness)

    indices = mesh.array("creaseIndices", np.int64)
    if not len(indices):
        return
    lengths = mesh.array("creaseLengths", np.int64)
    sharpness = mesh.array("creaseSharpnesses", np.float64)
    _check_vertices(f"{path}.creaseIndices", indices, cage)
    edges = int((lengths - 1).sum())
    per_edge = len(sharpness) == edges
    if (
        lengths.sum() != len(indices)
        or lengths.min() < 2
        or not (per_edge or len(sharpness) == len(lengths))
    ):
        report.warn("creases whose lengths or sharpnesses do not fit are ignored", path)
        return
    if not per_edge:
        sharpness = np.repeat(sharpness, lengths - 1)
    last = np.zeros(len(indices), dtype=bool)
    last[np.cumsum(lengths) - 1] = True
    tail, head = indices[~last], indices[np.flatnonzero(~last) + 1]
    edge = np.array([*map(cage.find_edge, tail.tolist(), head.tolist())], dtype=np.int64)
    found = edge >= 0
    if not found.all():
        report.note("creases along what is no edge are ignored", path)
    _sharpen(cage.edge_sharpness, edge[found], sharpness[found])


def _sharpen(values: np.ndarray, where: np.ndarray, sharpness: np.ndarray) -> None:
    np.maximum.at(values, where, np.clip(sharpness, 0, surfaces().INFINITE))


def _check_vertices(attribute: str, indices: np.ndarray, cage) -> None:
    if not (indices.min() >= 0 and indices.max() < cage.vertex_count):
        raise Error(f"{attribute}: out of range for {cage.vertex_count} points")


def subdivide(
    mesh: Attributes,
    points: np.ndarray,
    counts: np.ndarray,
    indices: np.ndarray,
    detail: Detail,
    report: Report,
) -> tuple[Mesh, Subdivided] | None:
    """The triangles and limit normals of a subdivision surface whose cage is ``points`` (n, 3) and
    polygons; None if nothing is left to see."""
    surface = Subdivided(mesh, counts, indices, points, report)
    if not surface.cage.face_count:
        return None
    surface.refine(detail.level(points, surface.cage))
    if not len(surface.vertices):
        return None
    refined, limit = surface.smooth(points)
    normals = surface.normals(refined, limit)
    return (
        Mesh(limit.astype(np.float32), surface.vertices, normals, name=str(surface.path)),
        surface,
    )
