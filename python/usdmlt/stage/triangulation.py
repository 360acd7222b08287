"""Polygons into triangles: a fan where the polygon is convex, ear clipping where it is not.

Everything is in terms of *face corners*, positions in ``faceVertexIndices``: a triangle of corners
serves the values of every interpolation.
"""

from __future__ import annotations

import numpy as np

from usdmlt.stage.vectors import cross, dot

BLOCK = 1 << 18  # polygons tested at a time, to bound temporary memory


def triangulate(
    points: np.ndarray, counts: np.ndarray, indices: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Split faces into triangles.

    ``points`` (n, 3); ``counts`` (faces,) corners per face; ``indices`` the faces' vertices, end
    to end. Returns ``corners`` (triangles, 3) int32, positions in ``indices``, in the winding of
    the faces, and ``faces`` (triangles,) int32. Faces of fewer than three corners vanish.
    """
    if len(counts) and (counts == 3).all():
        corners = np.arange(len(indices), dtype=np.int32).reshape(-1, 3)
        return corners, np.arange(len(counts), dtype=np.int32)

    starts = np.cumsum(counts, dtype=np.int64) - counts
    all_corners, all_faces = [], []
    for sides in np.unique(counts[counts >= 3]):
        faces = np.flatnonzero(counts == sides)
        for block in np.array_split(faces, -(-len(faces) // BLOCK)):
            local, owner = _split(points, indices, starts[block], int(sides))
            all_corners.append(starts[block][owner][:, None] + local)
            all_faces.append(block[owner])
    if not all_corners:
        return np.empty((0, 3), np.int32), np.empty(0, np.int32)
    corners = np.concatenate(all_corners).astype(np.int32)
    faces = np.concatenate(all_faces).astype(np.int32)
    if len(all_faces) > 1:
        order = np.argsort(faces, kind="stable")
        corners, faces = corners[order], faces[order]
    return corners, faces


def _split(
    points: np.ndarray, indices: np.ndarray, starts: np.ndarray, sides: int
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate polygons of equally many sides.

    Returns local corners (triangles, 3) in 0 … sides-1, and which polygon each belongs to.
    """
    fan = np.array([(0, i, i + 1) for i in range(1, sides - 1)])
    everyone = np.repeat(np.arange(len(starts)), sides - 2)
    if sides == 3:
        return np.tile(fan, (len(starts), 1)), everyone

    polygons = points[indices[starts[:, None] + np.arange(sides)]].astype(np.float64)
    reflex = reflex_corners(polygons)
    if sides == 4:
        # The diagonal of a quadrilateral leaves from its reflex corner, if it has one.
        first = np.where(reflex.any(axis=1), reflex.argmax(axis=1), 0)
        local = (fan[None] + first[:, None, None]) % 4
        return local.reshape(-1, 3), everyone

    local = np.tile(fan, (len(starts), 1, 1))
    for polygon in np.flatnonzero(reflex.any(axis=1)):
        local[polygon] = clip_ears(polygons[polygon])
    return local.reshape(-1, 3), everyone


def reflex_corners(polygons: np.ndarray) -> np.ndarray:
    """(polygons, sides) bool: corners that turn against the polygon's Newell normal."""
    sides = polygons.shape[1]
    following, previous = np.arange(1, sides + 1) % sides, np.arange(-1, sides - 1) % sides
    edges = polygons[:, following] - polygons
    normals = newell_normals(polygons)
    turns = dot(cross(edges[:, previous], edges), normals[:, None])
    return turns < -1e-9 * dot(normals, normals)[:, None]


def newell_normals(polygons: np.ndarray) -> np.ndarray:
    """(polygons, 3): twice the vector area, from (polygons, sides, 3) points (Newell's method)."""
    if polygons.shape[1] == 4:  # the cross product of the diagonals
        return cross(polygons[:, 2] - polygons[:, 0], polygons[:, 3] - polygons[:, 1])
    relative = polygons - polygons[:, :1]
    return cross(relative[:, :-1], relative[:, 1:]).sum(axis=1)


def clip_ears(polygon: np.ndarray) -> np.ndarray:
    """Triangulate one simple polygon, (sides, 3) points, by ear clipping (Meisters 1975).

    Returns (sides - 2, 3) corners. A polygon that crosses itself still gives that many triangles.
    """
    normal = newell_normals(polygon[None])[0]
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(polygon, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):  # dropping y mirrors the plane
        flat = flat * (-1.0, 1.0)

    left = list(range(len(polygon)))
    triangles = []
    while len(left) > 3:
        ear = _find_ear(flat, left)
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    triangles.append(tuple(left))
    return np.array(triangles)


def _find_ear(flat: np.ndarray, left: list[int]) -> int:
    """A convex corner whose triangle holds no other corner, or else the most convex one.

    Only reflex corners can be inside an ear. Ears that none so much as touches come first.
    """
    ring = flat[left]
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    turns = _cross(ring - before, after - ring)
    reflex = ring[turns <= 0]
    for tolerance in (0.0, 1e-12 * np.abs(turns).max()):
        for ear in np.flatnonzero(turns > 0):
            corners = (before[ear], ring[ear], after[ear])
            depth = np.full(len(reflex), np.inf)
            for i in range(3):
                edge = corners[i] - corners[i - 1]
                depth = np.minimum(depth, _cross(edge, reflex - corners[i - 1]))
            touches = depth >= 0 if tolerance == 0 else depth > tolerance
            # Corners at the same place as the ear's own do not spoil it: bridges repeat points.
            for corner in corners:
                touches &= (reflex != corner).any(axis=1)
            if not touches.any():
                return int(ear)
    return int(np.argmax(turns))


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
