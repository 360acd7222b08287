"""Where the vertices of a refined cage go in the limit, and the tangent plane there.

Limit masks: Halstead, Kass and DeRose (1993) for Catmull–Clark, Loop (1987) and Hoppe et al. (1994)
for triangles, Biermann, Levin and Zorin (2000) for creases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdmlt.stage.subdivision import (
    LOOP,
    Cage,
    Stencils,
    loop_beta,
    sharp_ends,
    valences,
    vertex_rules,
)
from usdmlt.stage.vectors import cross


def limit_positions(cage: Cage, scheme: str) -> Stencils:
    """From the vertices of a cage of quadrilaterals (Loop: triangles) to the limit surface.

    Catmull–Clark: (n² V + 4 sum E + sum F) / (n (n + 5)) with the opposite corners F of the faces;
    Loop: (V / (8 beta / 3) + sum E) / (n + 3 / (8 beta)); creases: (4 V + E + E) / 6.
    What is still sharp stays so.
    """
    stencils = Stencils(cage.vertex_count)
    rules, n = vertex_rules(cage, blend=False), valences(cage).astype(np.float64)
    if scheme == LOOP:
        neighbor = 1 / (n + 3 / (8 * loop_beta(n)))
        center = 1 - n * neighbor
    else:
        neighbor, center = 4 / (n * (n + 5)), n / (n + 5)
        across = cage.corner_vertices[cage.following[cage.following]]
        at_faces = (rules.smooth / (n * (n + 5)))[cage.corner_vertices]
        stencils.add(cage.corner_vertices, across, at_faces)
    vertices = np.arange(cage.vertex_count)
    stencils.add(vertices, vertices, rules.smooth * center + rules.crease * 2 / 3 + rules.corner)
    neighbor = rules.smooth * neighbor
    for end in (0, 1):
        near, far = cage.edge_vertices[:, end], cage.edge_vertices[:, 1 - end]
        stencils.add(near, far, neighbor[near] + rules.crease[near] / 6 * rules.crease_ends[:, end])
    return stencils


@dataclass
class Sectors:
    """The corners around vertices, counter-clockwise, apart where creases divide them.

    ``sector`` and ``position`` (corners,): which sector a corner is in, and the how-manieth of it.
    ``size`` (sectors,) faces; ``closed`` (sectors,): whether it goes all the way round.
    """

    sector: np.ndarray
    position: np.ndarray
    size: np.ndarray
    closed: np.ndarray


def find_sectors(cage: Cage) -> Sectors:
    """Walk round all vertices at once. A single sharp edge, a dart, divides nothing."""
    divided = sharp_ends(cage, cage.edge_sharpness)[cage.corner_vertices] >= 2
    sharp = cage.edge_sharpness[cage.corner_edges] > 0
    twin = _twins(cage)
    left = twin[cage.preceding]  # the corner at the same vertex beyond the preceding edge
    left[divided & sharp[cage.preceding]] = -1
    has_right = np.zeros(cage.corner_count, dtype=bool)
    has_right[left[left >= 0]] = True

    sector = np.full(cage.corner_count, -1)
    position = np.zeros(cage.corner_count, dtype=np.int64)
    starts, closed = np.flatnonzero(~has_right), []
    count, rounds = 0, 0
    while len(starts) or rounds == 0:
        closed.append(np.full(len(starts), rounds > 0))
        current, names, step = starts, count + np.arange(len(starts)), 0
        while len(current):
            sector[current], position[current] = names, step
            following = left[current]
            going = following >= 0
            going[going] = sector[following[going]] < 0
            current, names, step = following[going], names[going], step + 1
        count, rounds = count + len(starts), rounds + 1
        # What is left goes all the way round its vertex: one start for each.
        waiting = np.flatnonzero(sector < 0)
        first = np.full(cage.vertex_count, -1)
        first[cage.corner_vertices[waiting]] = waiting
        starts = first[first >= 0]
    size = np.bincount(sector, minlength=count)
    return Sectors(sector, position, size, np.concatenate(closed))


def _twins(cage: Cage) -> np.ndarray:
    """(corners,) the corner whose edge is the same the other way round; -1 if there is none."""
    corners, edges = np.arange(cage.corner_count), cage.corner_edges
    last, first = np.full((2, cage.edge_count), -1)
    last[edges] = corners
    first[edges[::-1]] = corners[::-1]
    twin = np.where(last[edges] == corners, first[edges], last[edges])
    alone = np.bincount(edges, minlength=cage.edge_count)[edges] != 2
    turned = cage.corner_vertices[twin] != cage.corner_vertices[cage.following]
    return np.where(alone | turned, -1, twin)


def limit_normals(
    cage: Cage, scheme: str, values: np.ndarray, limit: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (sectors, 3) and the sector of each corner, from the vertices ``values`` of the
    cage and their ``limit`` positions. Corners, and where the surface has no tangent plane, get the
    mean normal of the faces beside them."""
    sectors = find_sectors(cage)
    u, v = _tangents(cage, scheme, sectors)
    normals = cross(u(values), v(values))

    at = limit[cage.corner_vertices]
    ahead = limit[cage.corner_vertices[cage.following]] - at
    behind = limit[cage.corner_vertices[cage.preceding]] - at
    facing, flat = cross(ahead, behind), np.empty_like(normals)
    for axis in range(3):
        flat[:, axis] = np.bincount(sectors.sector, facing[:, axis], len(sectors.size))
    return _unit(normals, _unit(flat, None)), sectors.sector


def _unit(vectors: np.ndarray, fallback: np.ndarray | None) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if fallback is None:
        fallback = np.broadcast_to(np.array([0.0, 0.0, 1.0]), vectors.shape)
    return np.divide(vectors, length, out=fallback.copy(), where=length > 0)


def _tangents(cage: Cage, scheme: str, sectors: Sectors) -> tuple[Stencils, Stencils]:
    """Two tangents per sector; none, that is zero, at corners.

    They are the left eigenvectors of the subdivision matrix around a vertex V with edge ends E_j
    and opposite corners F_j. Closed sectors of n faces, t = 2 pi/n: the sum of
    cos(j t) A E_j + (cos(j t) + cos((j + 1) t)) F_j, and with sines, where
    A = 1 + cos t + cos(t/2) sqrt(2 (9 + cos t)). Open ones of k faces, t = pi/k: E_0 - E_k along
    the crease; across it the same sines, and for V and the ends what the equations of their columns
    leave: see :func:`_crease_ends`. Loop's have E_j only, and A = 1. (Biermann et al. have another
    mask across creases, for their modified rules.)
    """
    count, sector, j = len(sectors.size), sectors.sector, sectors.position
    along, across = Stencils(count), Stencils(count)
    vertex = np.zeros(count, dtype=np.int64)
    vertex[sector] = cage.corner_vertices
    sharp = sharp_ends(cage, cage.edge_sharpness)[vertex]
    corner = (cage.vertex_sharpness[vertex] > 0) | (sharp > 2)
    size = sectors.size[sector]
    ahead = cage.corner_vertices[cage.following]
    behind = cage.corner_vertices[cage.preceding]
    opposite = cage.corner_vertices[cage.following[cage.following]]

    # Waves per number of faces, of which there are few, and position: there are many corners.
    faces, kind = np.unique(sectors.size, return_inverse=True)
    kind = kind.ravel()[sector]
    steps = np.arange(faces.max(initial=1) + 2)

    def add_waves(chosen: np.ndarray, turn: float, waves: tuple) -> None:
        s, k, n = sector[chosen], j[chosen], kind[chosen]
        angles = np.outer(turn / faces, steps)
        edge = _edge_weight(scheme, turn / faces)[:, None]
        for stencils, wave in waves:
            table = wave(angles)
            stencils.add(s, ahead[chosen], (edge * table)[n, k])
            if scheme != LOOP:
                stencils.add(s, opposite[chosen], (table[:, :-1] + table[:, 1:])[n, k])

    closed = (sectors.closed & ~corner)[sector]
    add_waves(closed, 2 * np.pi, ((along, np.cos), (across, np.sin)))

    open_ = (~sectors.closed & ~corner)[sector]
    first, last = open_ & (j == 0), open_ & (j == size - 1)
    along.add(sector[first], ahead[first], 1.0)
    along.add(sector[last], behind[last], -1.0)
    more = open_ & (size > 1)
    add_waves(more, np.pi, ((across, np.sin),))
    at_end, at_center = _crease_ends(scheme, faces)
    across.add(sector[first], ahead[first], at_end[kind[first]])
    across.add(sector[last], behind[last], at_end[kind[last]])
    across.add(sector[first], cage.corner_vertices[first], at_center[kind[first]])
    return along, across


def _edge_weight(scheme: str, t: np.ndarray) -> np.ndarray:
    if scheme == LOOP:
        return np.ones_like(t)
    return 1 + np.cos(t) + np.cos(t / 2) * np.sqrt(2 * (9 + np.cos(t)))


def _crease_ends(scheme: str, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The weights across a crease of its neighbours E_0 and E_k, and of the vertex.

    With eigenvalue l, the column of E_0 says (l - 1/2) a = b/8 + sin t (A + 4)/16, and all weights
    add up to 0; Loop: (l - 1/2) a = b/8 + sin t / 8. A single face has a = 1, b = -2.
    """
    t = np.pi / np.maximum(faces, 2)
    cot = 1 / np.tan(t / 2)
    weight = _edge_weight(scheme, t)
    if scheme == LOOP:
        eigenvalue, inner, total = 0.375 + np.cos(t) / 4, np.sin(t) / 8, cot
    else:
        eigenvalue = (4 + weight) / 16
        inner, total = np.sin(t) * (weight + 4) / 16, (weight + 2) * cot
    end = (inner - total / 8) / (eigenvalue - 0.25)
    return np.where(faces == 1, 1.0, end), np.where(faces == 1, -2.0, -2 * end - total)
