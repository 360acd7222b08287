"""Subdivision surfaces of meshes: the refined cage, and primvars of every interpolation on it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Mesh, Primvar
from usdmlt.stage.detail import Detail
from usdmlt.stage.face_varying import face_varying_cage
from usdmlt.stage.primvars import fits
from usdmlt.stage.subdivision import (
    BILINEAR,
    CATMULL_CLARK,
    INFINITE,
    LOOP,
    Cage,
    bilinear,
    build_cage,
    refine,
)
from usdmlt.stage.subdivision_limit import limit_normals, limit_positions
from usdmlt.stage.triangulation import triangulate
from usdmlt.stage.vectors import cross


class Subdivided:
    """A subdivision surface: what was authored, and its triangles at one level of refinement.

    Stands where a :class:`~usdmlt.stage.primvars.Topology` does for polygons: ``vertices``
    (triangles, 3) of the refined points, ``faces`` (triangles,) the authored face of each.
    """

    def __init__(
        self,
        mesh: UsdGeom.Mesh,
        counts: np.ndarray,
        indices: np.ndarray,
        points: np.ndarray,
        time: Usd.TimeCode,
        report: Report,
    ):
        self.path = mesh.GetPath()
        self.scheme = str(mesh.GetSubdivisionSchemeAttr().Get(time))
        self.point_count, self.face_count = len(points), len(counts)
        self.corner_count = len(indices)
        self.left_handed = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
        self.rule = str(mesh.GetFaceVaryingLinearInterpolationAttr().Get(time))
        triangles = str(mesh.GetTriangleSubdivisionRuleAttr().Get(time))
        self.smooth_triangles = triangles == UsdGeom.Tokens.smooth

        # The corners and faces that take part, by their authored numbers.
        self.corners, self.owners, counts = self._usable(points, counts, indices, report)
        self.counts = counts
        self.cage = build_cage(counts, indices[self.corners], len(points))
        read_sharpness(mesh, self.cage, time, report)
        boundary = str(mesh.GetInterpolateBoundaryAttr().Get(time))
        self.hidden = self._hidden_faces(mesh, boundary, time)
        if boundary == UsdGeom.Tokens.edgeAndCorner:
            faces = np.bincount(self.cage.corner_vertices, minlength=self.cage.vertex_count)
            self.cage.vertex_sharpness[faces == 1] = INFINITE

    def _usable(self, points, counts, indices, report) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Faces of at least three sides, none of them from a vertex to itself; triangles if the
        scheme asks for them."""
        sides = 3 if self.scheme == LOOP else None
        if sides and (counts != sides).any():
            report.warn("Loop's scheme is for triangles: other faces are split", self.path)
            corners, owners = triangulate(points, counts, indices)
            counts, corners = np.full(len(owners), 3), corners.ravel()
        else:
            owners, corners = np.arange(len(counts)), np.arange(len(indices))
        face = np.repeat(np.arange(len(counts)), counts)
        starts = np.repeat(np.cumsum(counts) - counts, counts)
        position = np.arange(len(corners)) - starts
        following = starts + (position + 1) % np.repeat(counts, counts)
        collapsed = indices[corners] == indices[corners[following]]
        good = counts >= 3
        good[face[collapsed]] = False
        if not good.all():
            report.note("faces without area are left out", self.path)
        return corners[good[face]], owners[good], counts[good]

    def _hidden_faces(self, mesh: UsdGeom.Mesh, boundary: str, time: Usd.TimeCode) -> np.ndarray:
        """(cage faces,): holes, and, if boundaries are not interpolated, the faces beside them."""
        hidden = np.zeros(self.cage.face_count, dtype=bool)
        holes = np.asarray(mesh.GetHoleIndicesAttr().Get(time) or [], dtype=np.int64)
        if len(holes):
            if not (holes.min() >= 0 and holes.max() < self.face_count):
                raise Error(f"{self.path}: holeIndices out of range (0 to {self.face_count - 1})")
            hidden |= np.isin(self.owners, holes)
        if boundary == UsdGeom.Tokens.none:
            uses = np.bincount(self.cage.corner_edges, minlength=self.cage.edge_count)
            beside = np.zeros(self.cage.vertex_count, dtype=bool)
            beside[self.cage.edge_vertices[uses < 2]] = True
            beside &= self.cage.vertex_sharpness < INFINITE
            hidden[self.cage.corner_faces[beside[self.cage.corner_vertices]]] = True
        return hidden

    @property
    def regular(self) -> bool:
        """Whether the cage itself has the faces that refinement makes, and limit masks need."""
        return bool((self.counts == (3 if self.scheme == LOOP else 4)).all())

    def refine(self, level: int) -> None:
        """Make the triangles of a level."""
        self.level = level if self.regular else max(level, 1)
        self.cages = [self.cage]
        self.refinements = []
        for _ in range(self.level):
            finer, refinement = refine(self.cages[-1], self.scheme, self.smooth_triangles)
            self.cages.append(finer)
            self.refinements.append(refinement)
        finest = self.cages[-1]
        sides = 3 if self.scheme == LOOP else 4
        corners = np.arange(finest.corner_count).reshape(-1, sides)
        if sides == 4:
            corners = corners[:, (0, 1, 2, 0, 2, 3)].reshape(-1, 3)
        if self.left_handed:
            corners = corners[:, (0, 2, 1)]
        cage_face = finest.corner_faces[corners[:, 0]]
        for coarser in self.cages[-2::-1]:
            cage_face = cage_face // 4 if sides == 3 else coarser.corner_faces[cage_face]
        shown = ~self.hidden[cage_face]
        self.triangle_corners = np.ascontiguousarray(corners[shown])
        self.vertices = finest.corner_vertices[self.triangle_corners].astype(np.int32)
        self.faces = self.owners[cage_face[shown]].astype(np.int32)

    # -- values

    def smooth(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (cage vertices, width) at the refined vertices, and in the limit."""
        for refinement in self.refinements:
            values = refinement(values)
        return values, values if self.limit is None else self.limit(values)

    @cached_property
    def limit(self):
        return None if self.scheme == BILINEAR else limit_positions(self.cages[-1], self.scheme)

    def normals(self, refined: np.ndarray, limit: np.ndarray) -> Primvar:
        """Unit normals of the limit surface, apart on both sides of creases."""
        finest = self.cages[-1]
        if self.scheme == BILINEAR:  # those of the bilinear patch each corner belongs to
            at = limit[finest.corner_vertices]
            ahead, behind = (
                limit[finest.corner_vertices[end]] - at
                for end in (finest.following, finest.preceding)
            )
            normals = cross(ahead, behind)
            length = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
            normals[length[:, 0] == 0] = (0.0, 0.0, 1.0)
            index = np.arange(finest.corner_count)
        else:
            normals, index = limit_normals(finest, self.scheme, refined, limit)
        if self.left_handed:
            normals = -normals
        corners = index[self.triangle_corners].astype(np.int32)
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
                values = _linear(cage, self.scheme)(values)
        else:
            values = self.smooth(values)[1]
        return Primvar(values.astype(np.float32))

    def _face_varying(self, values: np.ndarray, indices: np.ndarray | None) -> Primvar:
        index = np.arange(self.corner_count) if indices is None else indices
        linear = self.scheme == BILINEAR or self.rule == UsdGeom.Tokens.all
        cage, chosen = face_varying_cage(self.cage, self.counts, index[self.corners], self.rule)
        values = values[chosen]
        for _ in range(self.level):
            if linear:
                step, (cage, _) = _linear(cage, self.scheme), refine(cage, self.scheme)
            else:
                cage, step = refine(cage, self.scheme, self.smooth_triangles)
            values = step(values)
        if not linear:
            values = limit_positions(cage, self.scheme)(values)
        corners = cage.corner_vertices[self.triangle_corners].astype(np.int32)
        return Primvar(values.astype(np.float32), corners)


def _linear(cage: Cage, scheme: str):
    """Linear interpolation to the vertices that a scheme's refinement makes."""
    return bilinear(cage).others if scheme == LOOP else bilinear(cage)


def read_sharpness(mesh: UsdGeom.Mesh, cage: Cage, time: Usd.TimeCode, report: Report) -> None:
    """Creases and corners of a mesh into the sharpness of its cage."""
    path = mesh.GetPath()

    def numbers(attribute: Usd.Attribute, kind: type) -> np.ndarray:
        return np.asarray(attribute.Get(time) or [], dtype=kind)

    corners = numbers(mesh.GetCornerIndicesAttr(), np.int64)
    sharpness = numbers(mesh.GetCornerSharpnessesAttr(), np.float64)
    if len(corners) != len(sharpness):
        report.warn("corners whose number of sharpnesses does not fit are ignored", path)
    elif len(corners):
        _check_vertices(mesh.GetCornerIndicesAttr(), corners, cage)
        np.maximum.at(cage.vertex_sharpness, corners, np.clip(sharpness, 0, INFINITE))

    indices = numbers(mesh.GetCreaseIndicesAttr(), np.int64)
    lengths = numbers(mesh.GetCreaseLengthsAttr(), np.int64)
    sharpness = numbers(mesh.GetCreaseSharpnessesAttr(), np.float64)
    if not len(indices):
        return
    _check_vertices(mesh.GetCreaseIndicesAttr(), indices, cage)
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
    keys = cage.edge_vertices[:, 0] * cage.vertex_count + cage.edge_vertices[:, 1]
    wanted = np.minimum(tail, head) * cage.vertex_count + np.maximum(tail, head)
    edge = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
    found = keys[edge] == wanted if len(keys) else np.zeros(len(wanted), dtype=bool)
    if not found.all():
        report.note("creases along what is no edge are ignored", path)
    np.maximum.at(cage.edge_sharpness, edge[found], np.clip(sharpness[found], 0, INFINITE))


def _check_vertices(attribute: Usd.Attribute, indices: np.ndarray, cage: Cage) -> None:
    if not (indices.min() >= 0 and indices.max() < cage.vertex_count):
        raise Error(f"{attribute.GetPath()}: out of range for {cage.vertex_count} points")


def subdivide(
    mesh: UsdGeom.Mesh,
    points: np.ndarray,
    counts: np.ndarray,
    indices: np.ndarray,
    time: Usd.TimeCode,
    detail: Detail,
    report: Report,
) -> tuple[Mesh, Subdivided] | None:
    """The triangles and limit normals of a subdivision surface whose cage is ``points`` (n, 3) and
    polygons; None if nothing is left to see."""
    surface = Subdivided(mesh, counts, indices, points, time, report)
    if not surface.cage.face_count:
        return None
    surface.refine(detail.level(points, surface.cage.edge_vertices, surface.cage.corner_count))
    if not len(surface.vertices):
        return None
    refined, limit = surface.smooth(points)
    normals = surface.normals(refined, limit)
    return (
        Mesh(limit.astype(np.float32), surface.vertices, normals, name=str(surface.path)),
        surface,
    )


SCHEMES = (CATMULL_CLARK, LOOP, BILINEAR)
