"""UsdGeomMesh: polygons, orientation, holes, primvars, normals and face subsets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.native import surfaces
from usdmlt.scene import Mesh
from usdmlt.stage.detail import Detail
from usdmlt.stage.normals import authored_normals, normals_at_corners
from usdmlt.stage.primvars import Spreads, Topology
from usdmlt.stage.subdivided import SCHEMES, subdivide


@dataclass
class Polygons:
    """The authored topology of a mesh, checked."""

    points: np.ndarray
    counts: np.ndarray
    indices: np.ndarray


def read_polygons(mesh: UsdGeom.Mesh, points: np.ndarray, time: Usd.TimeCode) -> Polygons:
    """Face counts and indices; :class:`Error` if they contradict each other or the points."""
    path = mesh.GetPath()
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(time) or [], dtype=np.int32)
    indices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(time) or [], dtype=np.int32)
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise Error(f"{path}: point {bad} is not finite: {points[bad].tolist()}")
    if len(counts) and counts.min() < 0:
        raise Error(f"{path}: faceVertexCounts has a negative count")
    if counts.sum(dtype=np.int64) != len(indices):
        raise Error(
            f"{path}: faceVertexCounts add up to {counts.sum(dtype=np.int64)}, "
            f"but there are {len(indices)} faceVertexIndices"
        )
    if len(indices) and not (indices.min() >= 0 and indices.max() < len(points)):
        worst = int(indices.min() if indices.min() < 0 else indices.max())
        raise Error(f"{path}: faceVertexIndices has {worst}, out of range for {len(points)} points")
    return Polygons(points, counts, indices)


def read_topology(mesh: UsdGeom.Mesh, polygons: Polygons, time: Usd.TimeCode) -> Topology:
    """The triangles of a mesh: holes left out, counter-clockwise seen from outside."""
    corners, faces = surfaces().triangulate(polygons.points, polygons.counts, polygons.indices)
    if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        corners = np.ascontiguousarray(corners[:, (0, 2, 1)])
    vertices = polygons.indices[corners]
    topology = Topology(
        len(polygons.points), len(polygons.counts), len(polygons.indices), corners, faces, vertices
    )
    holes = mesh.GetHoleIndicesAttr().Get(time)
    if holes:
        holes = np.asarray(holes)
        if not (holes.min() >= 0 and holes.max() < topology.face_count):
            raise Error(
                f"{mesh.GetPath()}: holeIndices out of range (0 to {topology.face_count - 1})"
            )
        topology = topology.subset(~np.isin(faces, holes))
    return topology


def without_degenerate(topology: Topology, points: np.ndarray) -> Topology:
    """The topology without triangles of no area."""
    keep = surfaces().solid_triangles(points, topology.vertices)
    return topology if keep is None else topology.subset(keep)


def read_mesh(
    prim: Usd.Prim,
    points: np.ndarray,
    time: Usd.TimeCode,
    detail: Detail,
    report: Report,
) -> tuple[Mesh, Spreads] | None:
    """The triangles and normals of a mesh with points (n, 3) float32, and how they relate to what
    was authored; None if nothing is left to see.

    Authored normals do not apply to subdivision surfaces (UsdGeomMesh).
    """
    mesh, path = UsdGeom.Mesh(prim), prim.GetPath()
    polygons = read_polygons(mesh, points, time)
    scheme = str(mesh.GetSubdivisionSchemeAttr().Get(time))
    if scheme in SCHEMES and len(polygons.counts):
        return subdivide(mesh, points, polygons.counts, polygons.indices, time, detail, report)
    if scheme != UsdGeom.Tokens.none and scheme not in SCHEMES:
        report.warn(f"subdivision by the unknown scheme {scheme!r} is left out", path)

    topology = read_topology(mesh, polygons, time)
    if not len(topology.vertices):
        report.note("meshes without faces", path)
        return None
    solid = without_degenerate(topology, points)
    if len(solid.vertices) < len(topology.vertices):
        report.note("faces without area are left out", path)
    topology = solid
    if not len(topology.vertices):
        return None

    authored = authored_normals(mesh, topology, time, report)
    normals = authored and normals_at_corners(*authored, topology, points)
    return (
        Mesh(points=points, triangles=topology.vertices, normals=normals, name=str(path)),
        topology,
    )


def face_materials(
    topology: Spreads, default: int, subsets: list[tuple[Usd.Prim, np.ndarray, int]]
) -> int | np.ndarray:
    """One material for the mesh, or one per triangle where face subsets have their own."""
    if not subsets:
        return default
    per_face = np.full(topology.face_count, default, dtype=np.int32)
    for prim, faces, material in subsets:
        if len(faces) and not (faces.min() >= 0 and faces.max() < topology.face_count):
            raise Error(f"{prim.GetPath()}: indices out of range (0 to {topology.face_count - 1})")
        per_face[faces] = material
    per_triangle = per_face[topology.faces]
    if (per_triangle == per_triangle[0]).all():
        return int(per_triangle[0])
    return per_triangle
