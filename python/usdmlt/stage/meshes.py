"""UsdGeomMesh: polygons, orientation, holes, primvars, normals and face subsets."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.native import surfaces
from usdmlt.scene import Mesh
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.detail import Detail
from usdmlt.stage.normals import authored_normals, normals_at_corners
from usdmlt.stage.primvars import Spreads, Topology
from usdmlt.stage.subdivided import SCHEMES, subdivide

NOWHERE = np.empty(0, dtype=bool)


def read_mesh(
    mesh: Attributes, points: np.ndarray, detail: Detail, report: Report
) -> tuple[Mesh, Spreads] | None:
    """The triangles and normals of a mesh with points (n, 3) float32, and how they relate to what
    was authored; None if nothing is left to see. Raises :class:`Error` for polygons that contradict
    each other or the points.

    Authored normals do not apply to subdivision surfaces (UsdGeomMesh).
    """
    path = mesh.prim.GetPath()
    counts = mesh.array("faceVertexCounts", np.int32)
    indices = mesh.array("faceVertexIndices", np.int32)
    scheme = str(mesh["subdivisionScheme"])
    if scheme in SCHEMES and len(counts):
        _check(path, points, counts, indices)
        return subdivide(mesh, points, counts, indices, detail, report)
    if scheme != UsdGeom.Tokens.none and scheme not in SCHEMES:
        report.warn(f"subdivision by the unknown scheme {scheme!r} is left out", path)

    left_handed = mesh["orientation"] == UsdGeom.Tokens.leftHanded
    read = surfaces().visible_triangles(points, counts, indices, left_handed, _holes(mesh, counts))
    if read is None:
        _check(path, points, counts, indices)
    vertices, corners, faces, flat = read
    if vertices is None:
        vertices = indices.reshape(-1, 3)
    if flat:
        report.note("faces without area are left out", path)
    if not len(vertices):
        if not flat:
            report.note("meshes without faces", path)
        return None
    topology = Topology(len(points), len(counts), len(indices), vertices, corners, faces)
    authored = authored_normals(mesh, topology, report)
    normals = authored and normals_at_corners(*authored, topology, points)
    return Mesh(points=points, triangles=vertices, normals=normals, name=str(path)), topology


def _holes(mesh: Attributes, counts: np.ndarray) -> np.ndarray:
    """(faces,) bool; empty if there are none."""
    holes = mesh.array("holeIndices", np.int32)
    if not len(holes):
        return NOWHERE
    if not (holes.min() >= 0 and holes.max() < len(counts)):
        raise Error(f"{mesh.prim.GetPath()}: holeIndices out of range (0 to {len(counts) - 1})")
    hidden = np.zeros(len(counts), dtype=bool)
    hidden[holes] = True
    return hidden


def _check(path: Sdf.Path, points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> None:
    """Raise :class:`Error` for polygons that contradict each other or their points."""
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
