"""NurbsPatch as a mesh with exact normals, and the outer faces of TetMesh."""

from __future__ import annotations

import math

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Mesh, Primvar
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.curves import check_knots, read_points, read_weights
from usdmlt.stage.detail import Detail
from usdmlt.stage.normals import authored_normals, normals_at_corners
from usdmlt.stage.nurbs import basis, rational, sample_parameters
from usdmlt.stage.primvars import Topology
from usdmlt.stage.sampled import Sampled, Weights
from usdmlt.stage.vectors import cross

CHORD = 4.0  # pixels between samples
STEPS = (2, 64)  # samples per span, least and most


def read_nurbs_patch(
    prim: Usd.Prim, time: Usd.TimeCode, detail: Detail, report: Report
) -> tuple[Mesh, Sampled] | None:
    """The patch from range to range, with ``st`` from 0 to 1. Control points run along u first.
    Trim curves are not followed."""
    patch, path = UsdGeom.NurbsPatch(prim), prim.GetPath()
    points = read_points(patch, time)
    columns, rows = (
        int(a.Get(time) or 0) for a in (patch.GetUVertexCountAttr(), patch.GetVVertexCountAttr())
    )
    if points is None or not columns * rows:
        report.note("patches without points", path)
        return None
    if columns < 0 or rows < 0 or columns * rows != len(points):
        raise Error(f"{path}: {columns} x {rows} vertices, but there are {len(points)} points")
    if patch.GetTrimCurveCountsAttr().Get(time):
        report.warn("trim curves of patches are ignored", path)

    steps = _steps(points, detail)
    u = _direction(patch, "u", columns, time, steps)
    v = _direction(patch, "v", rows, time, steps)
    at, along_u = _product(u[1], v[1], columns), _product(u[2], v[1], columns)
    along_v = _product(u[1], v[2], columns)
    weights = read_weights(patch, len(points), time)
    if weights is not None:
        (at, along_u), (_, along_v) = (
            rational(at, along_u, weights),
            rational(at, along_v, weights),
        )
    positions = at(points)
    normals = cross(along_u(points), along_v(points))
    st = np.stack(np.meshgrid(_unit_range(u[0]), _unit_range(v[0])), axis=-1).reshape(-1, 2)

    a = (np.arange(len(v[0]) - 1)[:, None] * len(u[0]) + np.arange(len(u[0]) - 1)).ravel()
    width = len(u[0])
    quads = np.stack([a, a + 1, a + width + 1, a, a + width + 1, a + width], axis=1)
    triangles = quads.reshape(-1, 3).astype(np.int32)
    if patch.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        triangles, normals = np.ascontiguousarray(triangles[:, (0, 2, 1)]), -normals
    normals = _filled(normals, positions, triangles)
    mesh = Mesh(
        positions.astype(np.float32),
        triangles,
        Primvar(normals.astype(np.float32)),
        primvars={"st": Primvar(st.astype(np.float32))},
        name=str(path),
    )
    corners = _product(_linear_ends(u[0]), _linear_ends(v[0]), 2)
    return mesh, Sampled(triangles, np.zeros(len(triangles), np.int32), 1, at, corners)


def _direction(
    patch: UsdGeom.NurbsPatch, name: str, count: int, time: Usd.TimeCode, steps: int
) -> tuple[np.ndarray, Weights, Weights]:
    """Parameters along u or v, and the weights and slopes of the control points there."""
    prim, path = patch.GetPrim(), patch.GetPath()
    order = int(prim.GetAttribute(f"{name}Order").Get(time) or 0)
    knots = np.asarray(prim.GetAttribute(f"{name}Knots").Get(time) or [], dtype=np.float64)
    if not 1 < order <= count:
        raise Error(f"{path}: {name}Order {order} does not fit {count} control points")
    if len(knots) != count + order:
        raise Error(f"{path}: {len(knots)} {name}Knots, where {count + order} are needed")
    check_knots(path, knots)
    low, high = knots[order - 1], knots[count]
    limits = prim.GetAttribute(f"{name}Range").Get(time)
    if limits is not None:
        low, high = max(low, limits[0]), min(high, limits[1])
    if not low < high:
        raise Error(f"{path}: {name}Range is empty")
    at = sample_parameters(knots, order, low, high, steps)
    return at, *basis(knots, order, count, at)


def _product(u: Weights, v: Weights, columns: int) -> Weights:
    """The tensor product of weights along u and v: samples along u first."""
    index = columns * v.index[:, None, :, None] + u.index[None, :, None, :]
    weight = v.weight[:, None, :, None] * u.weight[None, :, None, :]
    samples, terms = len(u.index) * len(v.index), u.index.shape[1] * v.index.shape[1]
    return Weights(u.count * v.count, index.reshape(samples, terms), weight.reshape(samples, terms))


def _linear_ends(at: np.ndarray) -> Weights:
    """Between the values at the two ends, as varying primvars are interpolated."""
    u = _unit_range(at)
    index = np.broadcast_to([0, 1], (len(at), 2))
    return Weights(2, index, np.stack([1 - u, u], axis=1))


def _unit_range(at: np.ndarray) -> np.ndarray:
    return (at - at[0]) / (at[-1] - at[0])


def _filled(normals: np.ndarray, points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals; at poles, where an edge of the patch is one point, those of the triangles."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    poles = length[:, 0] <= 1e-9 * length.max(initial=0)
    if poles.any():
        a, b, c = (points[triangles[:, i]] for i in range(3))
        flat = np.zeros_like(normals)
        for i in range(3):
            np.add.at(flat, triangles[:, i], cross(b - a, c - a))
        normals[poles] = flat[poles]
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals[length[:, 0] == 0] = (0.0, 0.0, 1.0)
        length[length == 0] = 1
    return normals / length


def _steps(points: np.ndarray, detail: Detail) -> int:
    if detail.fixed is not None:
        return 4 * 2**detail.fixed
    lengths = np.linalg.norm(np.diff(points.astype(np.float64), axis=0), axis=1)
    pixels = detail.pixels(points, float(np.sqrt(np.mean(np.square(lengths)))))
    return int(np.clip(math.ceil(min(pixels, 1e6) / CHORD), *STEPS))


def read_tet_mesh(
    prim: Usd.Prim, time: Usd.TimeCode, detail: Detail, report: Report
) -> tuple[Mesh, Topology] | None:
    """The surface of a tetrahedral mesh: surfaceFaceVertexIndices, or what USD computes."""
    tets, path = UsdGeom.TetMesh(prim), prim.GetPath()
    points = read_points(tets, time)
    value = tets.GetSurfaceFaceVertexIndicesAttr().Get(time)
    indices = tets.GetTetVertexIndicesAttr().Get(time)
    count = 0 if indices is None else len(indices)
    if not value and count and points is not None:
        _check(path, "tetVertexIndices", np.asarray(indices), len(points))
        value = UsdGeom.TetMesh.ComputeSurfaceFaces(tets, time)
    if points is None or not value:
        report.note("tetrahedral meshes without a surface", path)
        return None
    triangles = np.array(value, dtype=np.int32).reshape(-1, 3)
    _check(path, "surfaceFaceVertexIndices", triangles, len(points))
    if tets.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        triangles = np.ascontiguousarray(triangles[:, (0, 2, 1)])
    # Values per tetrahedron or corner do not reach its surface: none will fit.
    topology = Topology(len(points), -1, -1, triangles)
    authored = authored_normals(Attributes(prim, time), topology, report)
    normals = authored and normals_at_corners(*authored, topology, points)
    return Mesh(points, triangles, normals, name=str(path)), topology


def _check(path: object, name: str, indices: np.ndarray, count: int) -> None:
    if not (indices.min() >= 0 and indices.max() < count):
        raise Error(f"{path}: {name} out of range for {count} points")
