"""The analytic gprims as fine meshes with exact normals and texture coordinates.

Sphere, cone, cylinder and capsule are surfaces of revolution of a profile about their axis;
s runs around the axis, t from the bottom to the top. Each has a seam and no shared poles, so that
every corner has its own normal and (s, t).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Mesh, Primvar
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.numbers import finite_number
from usdmlt.stage.primvars import Topology

AROUND = 96  # segments around the axis
ALONG = 48  # segments from pole to pole


@dataclass
class Shape:
    """Vertices with normals and (s, t), and the triangles between them."""

    points: np.ndarray
    normals: np.ndarray
    st: np.ndarray
    triangles: np.ndarray
    face_count: int


# ---------------------------------------------------------------------------------------------
# Surfaces of revolution about +z


@dataclass
class Profile:
    """A smooth curve in the half plane (radius, z), bottom to top, outside on its right."""

    radius: np.ndarray
    z: np.ndarray
    normal_radius: np.ndarray
    normal_z: np.ndarray


def line(r0: float, z0: float, r1: float, z1: float) -> Profile:
    """A straight profile: a disk, a cylinder's side or a cone's."""
    length = np.hypot(r1 - r0, z1 - z0)
    normal = ((z1 - z0) / length, (r0 - r1) / length)
    return Profile(
        np.array([r0, r1]), np.array([z0, z1]), np.full(2, normal[0]), np.full(2, normal[1])
    )


def arc(radius: float, z: float, low: float, high: float, segments: int) -> Profile:
    """Part of a circle about (0, z), between two latitudes."""
    latitude = np.linspace(low, high, segments + 1)
    cosine, sine = np.cos(latitude), np.sin(latitude)
    cosine[np.abs(latitude) == np.pi / 2] = 0.0
    return Profile(radius * cosine, z + radius * sine, cosine, sine)


def revolve(profiles: list[Profile]) -> Shape:
    """Turn profiles, from bottom to top, about the z axis."""
    lengths = [np.hypot(np.diff(p.radius), np.diff(p.z)) for p in profiles]
    total = sum(segment.sum() for segment in lengths)
    angle = np.arange(AROUND + 1) * (2 * np.pi / AROUND)
    cosine, sine = np.cos(angle), np.sin(angle)
    cosine[-1], sine[-1] = 1.0, 0.0

    points, normals, st, triangles = [], [], [], []
    start, below = 0, 0.0
    for profile, segments in zip(profiles, lengths, strict=True):
        rows = len(profile.z)
        ring = np.ones(AROUND + 1)
        points.append(_turn(profile.radius, profile.z, cosine, sine))
        normals.append(_turn(profile.normal_radius, profile.normal_z, cosine, sine))
        t = (below + np.concatenate([[0.0], np.cumsum(segments)])) / total
        st.append(
            np.stack([np.outer(np.ones(rows), angle / (2 * np.pi)), np.outer(t, ring)], axis=-1)
        )
        triangles.append(start + _grid(rows, profile.radius))
        start += rows * (AROUND + 1)
        below += segments.sum()
    quads = sum(len(p.z) - 1 for p in profiles) * AROUND
    return Shape(
        *(
            np.concatenate([a.reshape(-1, a.shape[-1]) for a in arrays])
            for arrays in (points, normals, st)
        ),
        np.concatenate(triangles).astype(np.int32),
        quads,
    )


def _turn(radius: np.ndarray, z: np.ndarray, cosine: np.ndarray, sine: np.ndarray) -> np.ndarray:
    """(rows, around, 3) vectors of a profile turned about z."""
    return np.stack(
        [np.outer(radius, cosine), np.outer(radius, sine), np.outer(z, np.ones_like(cosine))],
        axis=-1,
    )


def _grid(rows: int, radius: np.ndarray) -> np.ndarray:
    """Triangles between the rows of a turned profile; at a pole one per segment, not two."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(AROUND), indexing="ij")
    a = row * (AROUND + 1) + column
    b, c, d = a + 1, a + AROUND + 2, a + AROUND + 1
    lower, upper = np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)
    return np.concatenate(
        [lower[radius[:-1] > 0].reshape(-1, 3), upper[radius[1:] > 0].reshape(-1, 3)]
    )


# ---------------------------------------------------------------------------------------------
# The shapes, about +z. Sizes are positive.


@lru_cache(maxsize=16)
def sphere(radius: float) -> Shape:
    return revolve([arc(radius, 0.0, -np.pi / 2, np.pi / 2, ALONG)])


@lru_cache(maxsize=16)
def cylinder(bottom: float, top: float, height: float) -> Shape:
    """A cylinder, or the frustum of a cone; caps where the radius is not 0."""
    half = height / 2
    profiles = [line(bottom, -half, top, half)]
    if bottom > 0:
        profiles.insert(0, line(0.0, -half, bottom, -half))
    if top > 0:
        profiles.append(line(top, half, 0.0, half))
    return revolve(profiles)


@lru_cache(maxsize=16)
def capsule(bottom: float, top: float, height: float) -> Shape:
    """Half a sphere at either end of a cylinder, or of the frustum tangent to both.

    The frustum's normals have the latitude φ with sin φ = (bottom - top) / height; a sphere that
    holds the other is all there is to see.
    """
    half = height / 2
    if abs(bottom - top) >= height or max(bottom, top) == 0:
        z = -half if bottom > top else half
        return revolve([arc(max(bottom, top), z, -np.pi / 2, np.pi / 2, ALONG)])
    latitude = np.arcsin((bottom - top) / height)
    lower = arc(bottom, -half, -np.pi / 2, latitude, ALONG // 2)
    upper = arc(top, half, latitude, np.pi / 2, ALONG // 2)
    side = line(lower.radius[-1], lower.z[-1], upper.radius[0], upper.z[0])
    return revolve([profile for profile in (lower, side, upper) if profile.radius.any()])


@lru_cache(maxsize=16)
def cube(size: float) -> Shape:
    """Six faces, each with (s, t) from 0 to 1."""
    faces = [_rectangle(axis, sign) for axis in range(3) for sign in (-1.0, 1.0)]
    corners = np.concatenate([face.points for face in faces]) * size
    triangles = np.concatenate([face.triangles + 4 * i for i, face in enumerate(faces)])
    return Shape(
        corners,
        np.concatenate([face.normals for face in faces]),
        np.concatenate([face.st for face in faces]),
        triangles,
        6,
    )


def _rectangle(axis: int, sign: float) -> Shape:
    """A unit square that faces along an axis, half a unit from the origin."""
    st = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points = np.empty((4, 3))
    points[:, axis] = 0.5 * sign
    points[:, (axis + 1) % 3] = (st[:, 0] - 0.5) * sign
    points[:, (axis + 2) % 3] = st[:, 1] - 0.5
    normals = np.zeros((4, 3))
    normals[:, axis] = sign
    return Shape(points, normals, st, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), 1)


def plane(width: float, length: float, axis: str) -> Shape:
    """A rectangle that faces +axis: its width along x, or z for axis X; its length along y, or z
    for axis Y (UsdGeomPlane)."""
    st = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    across, along, normal = {"X": (2, 1, 0), "Y": (0, 2, 1), "Z": (0, 1, 2)}[axis]
    points = np.zeros((4, 3))
    points[:, across] = (st[:, 0] - 0.5) * width
    points[:, along] = (st[:, 1] - 0.5) * length
    normals = np.zeros((4, 3))
    normals[:, normal] = 1.0
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    if axis != "Z":  # z × y and x × z point along the negative axis
        triangles = triangles[:, ::-1]
    return Shape(points, normals, st, triangles, 1)


# ---------------------------------------------------------------------------------------------
# Reading


def _length(shape: Attributes, name: str) -> float:
    value = finite_number(shape.prim, name, shape[name])
    if value < 0:
        raise Error(f"{shape.prim.GetPath()}: {name} is {value:g}; it must be a positive length")
    return value


def _along_axis(shape: Shape, axis: str) -> Shape:
    """A shape about z turned to lie about another axis, by a cyclic change of coordinates."""
    order = {"X": (2, 0, 1), "Y": (1, 2, 0), "Z": (0, 1, 2)}[axis]
    return Shape(
        shape.points[:, order], shape.normals[:, order], shape.st, shape.triangles, shape.face_count
    )


Size = Callable[[str], float]

# Type name: the shape for its sizes and axis. Sizes of 0 make nothing to see.
READERS: dict[str, Callable[[Size, str], Shape]] = {
    "Sphere": lambda size, axis: sphere(size("radius")),
    "Cube": lambda size, axis: cube(size("size")),
    "Cone": lambda size, axis: _along_axis(cylinder(size("radius"), 0.0, size("height")), axis),
    "Cylinder": lambda size, axis: _along_axis(
        cylinder(size("radius"), size("radius"), size("height")), axis
    ),
    "Cylinder_1": lambda size, axis: _along_axis(
        cylinder(size("radiusBottom"), size("radiusTop"), size("height")), axis
    ),
    "Capsule": lambda size, axis: _along_axis(
        capsule(size("radius"), size("radius"), size("height")), axis
    ),
    "Capsule_1": lambda size, axis: _along_axis(
        capsule(size("radiusBottom"), size("radiusTop"), size("height")), axis
    ),
    "Plane": lambda size, axis: plane(size("width"), size("length"), axis),
}


POINT_SPHERE = "sphere of a point"  # a kind of its own: the unit sphere


def read_gprim(attributes: Attributes, kind: str, report: Report) -> tuple[Mesh, Topology] | None:
    """The mesh of an analytic gprim, with ``st``; None, with a note, if it has no size."""
    prim = attributes.prim
    axis = str(attributes["axis"] or "Z")
    if axis not in ("X", "Y", "Z"):
        raise Error(f"{prim.GetPath()}: axis is '{axis}'; it must be X, Y or Z")
    if kind == POINT_SPHERE:
        return _mesh(prim, sphere(1.0), left_handed=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        shape = READERS[kind](lambda name: _length(attributes, name), axis)
    if not np.isfinite(shape.points).all() or not np.isfinite(shape.normals).all():
        return _nothing(prim, report)
    extent = np.ptp(shape.points, axis=0)
    if np.count_nonzero(extent) < (2 if kind == "Plane" else 3):
        return _nothing(prim, report)
    return _mesh(prim, shape, attributes["orientation"] == UsdGeom.Tokens.leftHanded)


def _mesh(prim: Usd.Prim, shape: Shape, left_handed: bool) -> tuple[Mesh, Topology]:
    triangles = shape.triangles
    if left_handed:
        triangles = np.ascontiguousarray(triangles[:, (0, 2, 1)])
    mesh = Mesh(
        points=shape.points.astype(np.float32),
        triangles=np.ascontiguousarray(triangles),
        normals=Primvar(shape.normals.astype(np.float32)),
        primvars={"st": Primvar(shape.st.astype(np.float32))},
        name=str(prim.GetPath()),
    )
    # What primvars other than constant ones mean on these shapes is not defined; none will fit.
    return mesh, Topology(-1, -1, -1, mesh.triangles)


def _nothing(prim: Usd.Prim, report: Report) -> None:
    report.note("shapes without extent are left out", prim.GetPath())
    return None
