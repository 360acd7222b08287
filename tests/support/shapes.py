"""Meshes, transforms and cameras for tests. Matrices act on row vectors, as in the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from usdmlt.scene import Camera, Mesh, Primvar

Vector = Sequence[float] | np.ndarray


# ---------------------------------------------------------------------------------------------
# Transforms


def translate(x: float, y: float, z: float) -> np.ndarray:
    m = np.eye(4)
    m[3, :3] = x, y, z
    return m


def scale(x: float, y: float | None = None, z: float | None = None) -> np.ndarray:
    return np.diag([x, x if y is None else y, x if z is None else z, 1.0])


def rotate(axis: Vector, degrees: float) -> np.ndarray:
    """Right-handed rotation about an axis (Rodrigues' formula, transposed for row vectors)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    t = math.radians(degrees)
    m = np.eye(4)
    m[:3, :3] = (np.eye(3) + math.sin(t) * k + (1 - math.cos(t)) * k @ k).T
    return m


def facing(position: Vector, target: Vector, up: Vector = (0, 1, 0)) -> np.ndarray:
    """Local -z towards the target: cameras look, and flat lights emit, along it."""
    position, target = np.asarray(position, float), np.asarray(target, float)
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    m = np.eye(4)
    m[0, :3], m[1, :3], m[2, :3], m[3, :3] = right, np.cross(back, right), back, position
    return m


# ---------------------------------------------------------------------------------------------
# Cameras


def perspective(
    position: Vector,
    target: Vector,
    fov_degrees: float = 40.0,
    aspect: float = 1.5,
    up: Vector = (0, 1, 0),
    **others: object,
) -> Camera:
    """`fov_degrees` is vertical."""
    h = math.tan(math.radians(fov_degrees) / 2)
    window = (-h * aspect, h * aspect, -h, h)
    return Camera(facing(position, target, up), "perspective", window, **others)


def orthographic(
    position: Vector,
    target: Vector,
    height: float,
    aspect: float = 1.5,
    up: Vector = (0, 1, 0),
    **others: object,
) -> Camera:
    h = height / 2
    window = (-h * aspect, h * aspect, -h, h)
    return Camera(facing(position, target, up), "orthographic", window, **others)


# ---------------------------------------------------------------------------------------------
# Meshes


def mesh(points: object, triangles: object, material: int = 0, **others: object) -> Mesh:
    return Mesh(
        np.asarray(points, np.float32).reshape(-1, 3),
        np.asarray(triangles, np.int32).reshape(-1, 3),
        materials=material,
        **others,
    )


def quad(corner: Vector, u: Vector, v: Vector, material: int = 0, **others: object) -> Mesh:
    """A parallelogram whose outside is u × v, with texture coordinates `st` along u and v."""
    corner, u, v = (np.asarray(a, float) for a in (corner, u, v))
    st = Primvar(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
    others.setdefault("primvars", {"st": st})
    points = [corner, corner + u, corner + u + v, corner + v]
    return mesh(points, [[0, 1, 2], [0, 2, 3]], material, **others)


def floor(material: int = 0, half: float = 3.0, y: float = 0.0, **others: object) -> Mesh:
    """A square that faces up."""
    return quad((-half, y, half), (2 * half, 0, 0), (0, 0, -2 * half), material, **others)


def box(
    lower: Vector = (-0.5, -0.5, -0.5),
    upper: Vector = (0.5, 0.5, 0.5),
    material: int = 0,
    **others: object,
) -> Mesh:
    corners = [[(lower, upper)[i >> a & 1][a] for a in range(3)] for i in range(8)]
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return mesh(corners, triangles, material, **others)


def sphere(
    radius: float = 1.0,
    material: int = 0,
    rings: int = 16,
    smooth: bool = False,
    inward: bool = False,
    **others: object,
) -> Mesh:
    """A polyhedron with its vertices on the sphere; `smooth` adds the sphere's normals."""
    segments = 2 * rings
    theta = np.linspace(0, math.pi, rings + 1)[1:-1]
    phi = 2 * math.pi * np.arange(segments) / segments
    ring = np.stack(np.broadcast_arrays(
        np.sin(theta)[:, None] * np.sin(phi),
        np.cos(theta)[:, None],
        np.sin(theta)[:, None] * np.cos(phi),
    ), -1).reshape(-1, 3)  # fmt: skip
    directions = np.concatenate([[[0, 1, 0]], ring, [[0, -1, 0]]])
    last = len(directions) - 1
    at = lambda i, j: 1 + i * segments + j % segments  # noqa: E731
    triangles = []
    for j in range(segments):
        triangles += [(0, at(0, j), at(0, j + 1)), (last, at(rings - 2, j + 1), at(rings - 2, j))]
        for i in range(rings - 2):
            a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
            triangles += [(a, b, c), (a, c, d)]
    triangles = np.array(triangles)
    if inward:
        triangles, directions = triangles[:, ::-1], -directions
    if smooth:
        others["normals"] = Primvar(directions.astype(np.float32))
    sign = -1 if inward else 1
    return mesh(sign * radius * directions, triangles, material, **others)


def bumpy_sheet(
    material: int = 0, n: int = 24, half: float = 3.0, depth: float = 0.25, **others: object
) -> Mesh:
    """Waves over the xz plane, coarsely triangulated, with the normals of the smooth waves."""
    x = np.linspace(-half, half, n + 1)
    X, Z = np.meshgrid(x, x, indexing="ij")
    k = 4.0
    points = np.stack([X, depth * np.sin(k * X) * np.cos(k * Z), Z], -1)
    slope_x = depth * k * np.cos(k * X) * np.cos(k * Z)
    slope_z = -depth * k * np.sin(k * X) * np.sin(k * Z)
    normals = np.stack([-slope_x, np.ones_like(X), -slope_z], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = (i * (n + 1) + j).ravel()
    b, c, d = a + 1, a + n + 2, a + n + 1
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    others.setdefault("normals", Primvar(normals.reshape(-1, 3).astype(np.float32)))
    return mesh(points, triangles, material, **others)


# ---------------------------------------------------------------------------------------------
# What meshes are like


def at_corners(primvar: Primvar, mesh: Mesh) -> np.ndarray:
    """(triangles, 3, width): the values at the corners of triangles."""
    corners = mesh.triangles if primvar.corners is None else primvar.corners
    return primvar.values[corners]


def face_normals(mesh: Mesh) -> np.ndarray:
    """(triangles, 3) unit normals."""
    a, b, c = corners_of(mesh)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def volume(mesh: Mesh) -> float:
    """What a closed mesh holds: positive where triangles face outwards."""
    a, b, c = corners_of(mesh)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def corners_of(mesh: Mesh) -> list[np.ndarray]:
    """Three times (triangles, 3) float64."""
    return [mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3)]
