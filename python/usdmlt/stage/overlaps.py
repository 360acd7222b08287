"""Bodies of media that overlap in part, where nothing says which of them counts.

Told by a sample of the vertices of either that lie inside of the other: all of them do where one
body holds the other, which needs no priority, and none where they are apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from usdmlt.errors import Report
from usdmlt.scene import Mesh, Volume

MOST_BODIES = 400  # whose pairs are looked at
VERTICES = 256  # of a body that are looked at
MOST_TESTS = 1 << 26  # vertices times triangles, of a pair
DIRECTION = np.array([0.8017, 0.2673, 0.5345])  # of the rays that tell: through no edge by design
SHRUNK = 1e-3  # towards the middle, so that what touches is no overlap


def note_overlaps(bodies: Sequence[Mesh | Volume], report: Report) -> None:
    """Name the pairs of one priority and of different media."""
    for a, b in _pairs(bodies):
        if _is_cut(a, b) or _is_cut(b, a):
            report.note(
                "media overlap without usdmlt:mediumPriority: the smaller body counts",
                f"{a.name} and {b.name}",
            )


def _pairs(bodies: Sequence[Mesh | Volume]) -> Iterator[tuple[Mesh | Volume, Mesh | Volume]]:
    """Those whose boxes overlap."""
    if not 2 <= len(bodies) <= MOST_BODIES:
        return
    points = [_placed(body) for body in bodies]
    low = np.array([p.min(axis=0) for p in points])
    high = np.array([p.max(axis=0) for p in points])
    for i, j in combinations(range(len(bodies)), 2):
        a, b = bodies[i], bodies[j]
        apart = (np.maximum(low[i], low[j]) >= np.minimum(high[i], high[j])).any()
        if not apart and a.medium != b.medium and a.medium_priority == b.medium_priority:
            yield a, b


def _placed(body: Mesh | Volume) -> np.ndarray:
    transformed: np.ndarray = body.points @ body.transform[:3, :3] + body.transform[3, :3]
    return transformed


def _is_cut(body: Mesh | Volume, other: Mesh | Volume) -> bool:
    """Whether some of a body is inside of another one, and some is not."""
    points = _placed(body)[np.unique(body.triangles)]
    points = points[:: -(-len(points) // VERTICES)]
    points = points + SHRUNK * (points.mean(axis=0) - points)
    if len(points) * len(other.triangles) > MOST_TESTS:
        return False
    inside = _is_inside(points, _placed(other)[other.triangles])
    return bool(inside.any() and not inside.all())


def _is_inside(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) bool: which points an odd number of triangles (m, 3, 3) lie ahead of (Möller and
    Trumbore 1997)."""
    a = triangles[:, 0]
    u, v = triangles[:, 1] - a, triangles[:, 2] - a
    p = np.cross(DIRECTION, v)
    determinant = np.einsum("mi,mi->m", u, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / determinant
        count = np.zeros(len(points), dtype=np.int64)
        for index, point in enumerate(points):
            s = point - a
            q = np.cross(s, u)
            x = np.einsum("mi,mi->m", s, p) * scale
            y = (q @ DIRECTION) * scale
            t = np.einsum("mi,mi->m", v, q) * scale
            count[index] = np.count_nonzero((x >= 0) & (y >= 0) & (x + y <= 1) & (t > 0))
    return count % 2 == 1
