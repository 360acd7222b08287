"""UsdGeomPoints: spheres. Where nothing but place and size tells them apart they are instances of
one sphere; where primvars do, all of them are one mesh."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Mesh, Primvar
from usdmlt.stage.curves import read_points
from usdmlt.stage.detail import Detail
from usdmlt.stage.sampled import Sampled, one_each

DEFAULT_WIDTH = 1.0  # where no widths are authored, as in Storm
EDGE = 4.0  # pixels; the length of the edges of a sphere
FINEST = 5  # level of a sphere: 20 * 4^level triangles
LARGEST = 1 << 24  # triangles that all points of a prim have at most, where they can have fewer


def read_spheres(
    prim: Usd.Prim, time: Usd.TimeCode, report: Report, frame: Usd.TimeCode | None = None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Centers (n, 3) and radii (n,) of points; None if there are none. With a ``frame``, they are
    where velocities take them from there."""
    points, path = UsdGeom.Points(prim), prim.GetPath()
    centers = read_points(points, time, frame)
    if centers is None or not len(centers):
        report.note("points without points", path)
        return None
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("widths")
    authored = primvar and primvar.HasAuthoredValue()
    value = primvar.ComputeFlattened(time) if authored else points.GetWidthsAttr().Get(time)
    widths = np.asarray(value if value is not None else [], dtype=np.float64)
    if not len(widths):
        report.note(f"points without widths are {DEFAULT_WIDTH:g} wide", path)
        widths = np.array([DEFAULT_WIDTH])
    if len(widths) not in (1, len(centers)):
        report.warn("widths whose number does not fit: the first is used", path)
        widths = widths[:1]
    if not np.isfinite(widths).all():
        raise Error(f"{path}: widths are not all finite")
    return centers, np.broadcast_to(np.maximum(widths, 0) / 2, len(centers))


def alike(prim: Usd.Prim) -> bool:
    """Whether no primvar differs between the points of a prim."""
    constant = UsdGeom.Tokens.constant
    return all(
        primvar.GetInterpolation() == constant or primvar.GetPrimvarName() in ("widths", "normals")
        for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithAuthoredValues()
    )


def sphere_transforms(centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(n, 4, 4) from the unit sphere to each of those with a size."""
    shown = radii > 0
    transforms = np.zeros((int(shown.sum()), 4, 4))
    for axis in range(3):
        transforms[:, axis, axis] = radii[shown]
    transforms[:, 3, :3] = centers[shown]
    transforms[:, 3, 3] = 1.0
    return transforms


def read_point_mesh(
    prim: Usd.Prim, time: Usd.TimeCode, detail: Detail, report: Report
) -> tuple[Mesh, Sampled] | None:
    """All points of a prim as one mesh of spheres, as fine as the largest needs."""
    read = read_spheres(prim, time, report)
    if read is None:
        return None
    centers, radii = read
    shown = np.flatnonzero(radii > 0)
    if not len(shown):
        report.note("shapes without extent are left out", prim.GetPath())
        return None
    vertices, faces = icosphere(_level(centers, radii, len(shown), detail))
    points = (
        centers[shown, None]
        + _equal_area(vertices, faces) * radii[shown, None, None] * (vertices[None])
    )
    offsets = np.arange(len(shown))[:, None, None] * len(vertices)
    triangles = (faces[None] + offsets).reshape(-1, 3).astype(np.int32)
    mesh = Mesh(
        points.reshape(-1, 3).astype(np.float32),
        triangles,
        Primvar(np.tile(vertices, (len(shown), 1)).astype(np.float32)),
        name=str(prim.GetPath()),
    )
    each = one_each(np.repeat(shown, len(vertices)), len(centers))
    owner = np.repeat(shown, len(faces))
    return mesh, Sampled(triangles, owner, len(centers), each, each)


def _level(centers: np.ndarray, radii: np.ndarray, count: int, detail: Detail) -> int:
    if detail.fixed is not None:
        level = detail.fixed + 1
    else:
        # An icosahedron's edge is 1.05 of its radius, and halves with every level.
        pixels = 1.05 * detail.pixels(centers, float(radii.max()))
        level = math.ceil(math.log2(max(min(pixels, 1e6) / EDGE, 1.0)))
    room = max(int(math.log(max(LARGEST / (20 * count), 1), 4)), 0)
    return min(level, FINEST, room)


@lru_cache(maxsize=8)
def icosphere(level: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (n, 3) and triangles (20 * 4^level, 3): an icosahedron, its triangles split."""
    t = (1 + 5**0.5) / 2
    half = [(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0)]
    vertices = np.array([np.roll(v, shift) for shift in range(3) for v in half], dtype=float)
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    near = vertices @ vertices.T > 0.4  # neighbours are 63 degrees apart
    triangles = [
        (a, b, c) if np.linalg.det(vertices[[a, b, c]]) > 0 else (a, c, b)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    faces = np.array(triangles)
    for _ in range(level):
        edges = np.sort(faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
        distinct, index = np.unique(edges, axis=0, return_inverse=True)
        middle = vertices[distinct].sum(axis=1)
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        ab, bc, ca = (len(vertices) + index.reshape(-1, 3)).T
        a, b, c = faces.T
        vertices = np.concatenate([vertices, middle])
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    return vertices, faces


def _equal_area(vertices: np.ndarray, faces: np.ndarray) -> float:
    """How much larger a polyhedron has to be to cover as much of a picture, on average, as the
    sphere: a convex body's mean shadow is a quarter of its surface (Cauchy)."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return math.sqrt(4 * math.pi / area)
