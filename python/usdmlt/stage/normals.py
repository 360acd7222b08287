"""Shading normals of meshes: authored, or smooth ones for subdivision cages."""

from __future__ import annotations

import numpy as np
from pxr import UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Primvar
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.primvars import Topology
from usdmlt.stage.vectors import cross


def authored_normals(
    mesh: Attributes, topology: Topology, report: Report
) -> tuple[np.ndarray, np.ndarray | None, str] | None:
    """Values (count, 3), indices and interpolation; ``primvars:normals`` wins over ``normals``.

    None if there are none, or, with a warning, if their number does not fit the mesh.
    """
    if mesh.names.isdisjoint(("normals", "primvars:normals")):
        return None
    indices = None
    primvar = UsdGeom.Primvar(mesh.prim.GetAttribute("primvars:normals"))
    if primvar and primvar.HasAuthoredValue():
        path, value = primvar.GetAttr().GetPath(), primvar.Get(mesh.time)
        interpolation = primvar.GetInterpolation()
        if primvar.IsIndexed():
            indices = np.asarray(primvar.GetIndices(mesh.time))
    else:
        path, value = mesh.prim.GetPath().AppendProperty("normals"), mesh["normals"]
        interpolation = UsdGeom.PointBased(mesh.prim).GetNormalsInterpolation() if value else ""
    if not value:
        return None

    values = np.asarray(value)
    if values.dtype.kind not in "fiu" or values.ndim != 2 or values.shape[1] != 3:
        report.warn("normals that are no vectors are ignored", path)
        return None
    values = values.astype(np.float32, copy=False)
    count = len(values) if indices is None else len(indices)
    expected, _ = topology.elements(interpolation)
    if count != expected:
        report.warn(
            "normals whose number does not fit their interpolation are ignored",
            f"{path} ({count} {interpolation})",
        )
        return None
    if indices is not None and not (indices.min() >= 0 and indices.max() < len(values)):
        raise Error(f"{path}: normal indices out of range (0 to {len(values) - 1})")
    return values, indices, interpolation


def normals_at_corners(
    values: np.ndarray,
    indices: np.ndarray | None,
    interpolation: str,
    topology: Topology,
    points: np.ndarray,
) -> Primvar | None:
    """Unit normals as a primvar. Where one has no direction, the face's own takes its place."""
    primvar = topology.spread(values, indices, interpolation)
    if primvar is None:
        return None
    length = np.linalg.norm(values.astype(np.float64), axis=1, keepdims=True)
    usable = np.isfinite(length) & (length > 0)
    unit = np.divide(values, length, out=np.zeros_like(values), where=usable, casting="same_kind")
    if usable.all():
        return Primvar(unit, primvar.corners)

    corners = topology.vertices if primvar.corners is None else primvar.corners
    expanded = unit[corners]
    broken = ~usable[:, 0][corners]
    flat = face_normals(points, topology.vertices)
    expanded[broken] = np.repeat(flat[:, None], 3, axis=1)[broken]
    order = np.arange(corners.size, dtype=np.int32).reshape(-1, 3)
    return Primvar(expanded.reshape(-1, 3), order)


def face_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m, 3) float32 unit normals of triangles; zero for those without area."""
    normals = area_vectors(points, triangles)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0).astype(
        np.float32
    )


def area_vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m, 3) float64: normals of triangles, as long as twice their area."""
    a, b, c = (points[triangles[:, i]].astype(np.float64) for i in range(3))
    return cross(b - a, c - a)


def smooth_normals(points: np.ndarray, triangles: np.ndarray) -> Primvar:
    """Vertex normals: the mean of the adjacent triangles', weighted by area."""
    weighted = area_vectors(points, triangles)
    vertex = triangles.ravel()
    summed = np.empty((len(points), 3))
    for axis in range(3):
        contribution = np.repeat(weighted[:, axis], 3)
        summed[:, axis] = np.bincount(vertex, contribution, minlength=len(points))
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    fallback = np.broadcast_to(np.array([0.0, 0.0, 1.0]), summed.shape)
    unit = np.divide(summed, length, out=fallback.copy(), where=length > 0)
    return Primvar(unit.astype(np.float32))
