"""Face-varying values on subdivision surfaces: a cage of their own, cut open along seams."""

from __future__ import annotations

import numpy as np

from usdmlt.stage.subdivision import INFINITE, Cage, build_cage, sharp_ends


def face_varying_cage(
    cage: Cage, counts: np.ndarray, values: np.ndarray, rule: str
) -> tuple[Cage, np.ndarray]:
    """The cage whose vertices are the distinct values at each vertex of ``cage``.

    ``values`` (corners,): which value each corner has. ``rule``: faceVaryingLinearInterpolation of
    UsdGeomMesh. Also returns which value each vertex of the new cage has. Where it continues across
    an edge the surface's sharpness applies; its boundaries are creases, and ``rule`` says which of
    their vertices are corners (OpenSubdiv's Vtr::FVarLevel):

    * ``cornersOnly``: those with one face;
    * ``cornersPlus1``: and all where more than two values meet;
    * ``cornersPlus2``: and the other side of a corner, and where seams end (darts);
    * ``boundaries``: all of them. ``none``: none.
    """
    width = int(values.max()) + 1 if len(values) else 1
    keys, vertices = np.unique(cage.corner_vertices * width + values, return_inverse=True)
    vertices, owner, chosen = vertices.ravel(), keys // width, keys % width
    own = build_cage(counts, vertices, len(keys))
    seam = own.edge_sharpness >= INFINITE
    np.maximum.at(own.edge_sharpness, own.corner_edges, cage.edge_sharpness[cage.corner_edges])
    own.vertex_sharpness = cage.vertex_sharpness[owner]
    own.vertex_sharpness[_corners(cage, own, owner, seam, rule)] = INFINITE
    return own, chosen


def _corners(cage: Cage, own: Cage, owner: np.ndarray, seam: np.ndarray, rule: str) -> np.ndarray:
    """(vertices of ``own``,): which are corners by the rule."""
    single = np.bincount(own.corner_vertices, minlength=own.vertex_count) == 1
    on_seam = np.zeros(own.vertex_count, dtype=bool)
    on_seam[own.edge_vertices[seam]] = True
    if rule == "none":
        return np.zeros(own.vertex_count, dtype=bool)
    if rule in ("boundaries", "all"):
        return on_seam
    corners = single
    if rule == "cornersOnly":
        return corners
    number = np.bincount(owner, minlength=cage.vertex_count)
    split = sharp_ends(own, own.edge_sharpness) > 2  # seams or creases divide the value's faces
    corners = corners | (number > 2)[owner] | _both(split, owner, number)
    if rule == "cornersPlus2":
        boundary = np.zeros(cage.vertex_count, dtype=bool)
        uses = np.bincount(cage.corner_edges, minlength=cage.edge_count)
        boundary[cage.edge_vertices[uses != 2]] = True
        dart = on_seam & ((number == 1) & ~boundary)[owner]
        corners = corners | dart | _both(single, owner, number)
    return corners


def _both(which: np.ndarray, owner: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Both values of a vertex that has two if one of them is in ``which``."""
    either = np.zeros(len(number), dtype=bool)
    either[owner[which]] = True
    return (either & (number == 2))[owner]
