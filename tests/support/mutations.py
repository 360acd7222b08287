"""What proves the transition densities of mutations: single steps from paths of known density.

A kernel leaves f* unchanged if and only if, started from paths in proportion to f*, it leads to as
much as away from every part of path space. Bidirectional path tracing makes such paths: entries of
weight v = w f*/p, resampled in proportion to v. No mixing is needed, and one step is enough.

For every part B of path space the step's expected flow is Σ weight · a · (1[y ∈ B] − 1[x ∈ B]). All
paths of one bootstrap sample make one cluster, for they depend on each other; the sums of clusters
are independent of each other (what stratification adds makes them spread more evenly), and their
mean is 0. Parts are cells of histograms of class, raster point, edge lengths and f*.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from scipy import sparse, stats

from support.class_scenes import CLASS_SCENES
from support.media_scenes import MEDIA_SCENES
from support.rendering import build
from support.scenes import HEIGHT, SCENES, WIDTH
from support.statistics import sidak
from usdmlt import _core

MUTATIONS = (
    "new_path",
    "bidirectional",
    "lens",
    "caustic",
    "multi_chain",
    "lens_subpath",
    "glossy_lens",
    "glossy_caustic",
    "aimed",
)


def build_scene(name: str):
    return build((CLASS_SCENES | SCENES | MEDIA_SCENES)[name]())


# ---- Steps ------------------------------------------------------------------------------------


def class_name(key: float) -> str:
    """L, then D, S or M for every vertex between, then E."""
    bits, name = int(key), "L"
    while bits > 1:
        name += "DSM"[bits & 3]
        bits >>= 2
    return name + "E"


def steps(scene: object, weights: Mapping[str, float], **settings: object) -> dict:
    """Rows of steps whose proposal was made (see ``step_probe``)."""
    built = build_scene(scene) if isinstance(scene, str) else scene
    rows = _core.step_probe(built, dict(weights), **settings)
    assert rows["leaked_vertices"] == 0
    return rows


def of_mutation(rows: Mapping, name: str) -> dict:
    chosen = rows["mutation"] == MUTATIONS.index(name)
    return {
        key: column[chosen] if isinstance(column, np.ndarray) else column
        for key, column in rows.items()
    }


def acceptance(rows: Mapping, mutant: str | None = None) -> np.ndarray:
    """a(x→y) by its formula, with T as it is, or as the mutant has it.

    ``"selection"``: P(m|x) and P(m|y) are left out. ``"symmetric"``: T is.
    """
    if mutant == "symmetric":
        forward = back = np.zeros(rows["log_forward"].shape)
    elif mutant in (None, "selection"):
        forward, back = rows["log_forward"], rows["log_back"]
    else:
        forward, back = rows[mutant], rows[mutant + "_back"]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.exp(rows["log_target_after"] + back - rows["log_target_before"] - forward)
        if mutant != "selection":
            ratio = ratio * rows["selected_back"] / rows["selected"]
    return np.where(np.isneginf(forward), 0, np.clip(np.nan_to_num(ratio, nan=0.0), 0, 1))


# ---- Stationarity -----------------------------------------------------------------------------


def _quantile_cells(before: np.ndarray, after: np.ndarray, count: int) -> list[np.ndarray]:
    inner = np.quantile(before, np.linspace(0, 1, count + 1)[1:-1])
    return [np.searchsorted(inner, v) for v in (before, after)]


def _raster_cells(rows: Mapping, columns: int, lines: int) -> list[np.ndarray]:
    cells = []
    for when in ("before", "after"):
        x = np.clip(rows["raster_x_" + when] / WIDTH * columns, 0, columns - 1).astype(int)
        y = np.clip(rows["raster_y_" + when] / HEIGHT * lines, 0, lines - 1).astype(int)
        cells.append(y * columns + x)
    return cells


def partitions(rows: Mapping) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Histograms of path space: cell numbers before and after."""
    names = np.unique(np.concatenate([rows["class_before"], rows["class_after"]]))
    classes = [np.searchsorted(names, rows["class_" + when]) for when in ("before", "after")]
    yield "length", [rows["edges_" + when].astype(int) for when in ("before", "after")]
    yield (
        "class × raster cell",
        [c * 6 + r for c, r in zip(classes, _raster_cells(rows, 3, 2), strict=True)],
    )
    yield "raster cell", _raster_cells(rows, 8, 6)
    for what in ("log_target", "length", "eye_edge", "light_edge"):
        cells = _quantile_cells(rows[what + "_before"], rows[what + "_after"], 4)
        yield f"class × {what}", [c * 4 + q for c, q in zip(classes, cells, strict=True)]


FUNCTIONS = ("raster_x", "raster_y", "log_target", "length", "eye_edge", "light_edge")


def functions(rows: Mapping) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Bounded functions of paths, before and after: they see moves that stay within cells."""
    for what in FUNCTIONS:
        values = [rows[what + "_" + when] for when in ("before", "after")]
        lower, median, upper = np.quantile(values[0], (0.25, 0.5, 0.75))
        if upper > lower:
            yield what, [np.clip((v - median) / (upper - lower), -3, 3) for v in values]


def _z(cell: np.ndarray, flow: np.ndarray, cluster: np.ndarray, least: float) -> np.ndarray:
    """z of the sum of flow in every cell; a step that is taken for certain has flow 1.

    What flows out in many small parts may flow in by few large ones, which most seeds miss. One of
    them is therefore added to the variance, and cells whose flow in, or out, comes from fewer than
    ``least`` clusters, by (Σd)²/Σd², are left out: their sums are not normal."""
    if cell.size == 0:
        return np.empty(0)

    def sums(flow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        by_cluster = sparse.coo_matrix((flow, (cluster, cell))).tocsr()
        return tuple(np.asarray(d.sum(axis=0))[0] for d in (by_cluster, by_cluster.power(2)))

    with np.errstate(divide="ignore", invalid="ignore"):
        total, squares = sums(flow)
        z = total / np.sqrt(squares + 1)
        carried = [d**2 / d2 for d, d2 in map(sums, (np.maximum(flow, 0), np.minimum(flow, 0)))]
    return z[np.minimum(*carried) >= least]


def flow_z(rows: Mapping, weight: np.ndarray, least: float) -> np.ndarray:
    """z of the net flow into all cells of all partitions, and of the change of all functions, over
    all steps and over those within one class (pairs of states may be restricted symmetrically)."""
    z = []
    cluster = np.unique(rows["cluster"], return_inverse=True)[1]
    for _, (before, after) in partitions(rows):
        moved = (before != after) & (weight > 0)
        w, c = weight[moved], cluster[moved]
        z.append(_z(np.concatenate([after[moved], before[moved]]), np.concatenate([w, -w]),
                    np.concatenate([c, c]), least))  # fmt: skip
    classes = np.unique(rows["class_before"], return_inverse=True)[1]
    same = rows["class_before"] == rows["class_after"]
    for _, (before, after) in functions(rows):
        flow = weight * (after - before)
        z.append(_z(np.zeros(flow.size, int), flow, cluster, least))
        z.append(_z(classes[same], flow[same], cluster[same], least))
    return np.concatenate(z)


def stationarity(rows: Mapping, mutant: str | None = None, least: float = 50) -> float | None:
    """p-value of "f* is left unchanged": the smallest of all that ``flow_z`` looks at, after
    Šidák's correction for their number. None where there are too few steps to tell."""
    a = rows["weight_after"] if mutant is None else acceptance(rows, mutant)
    weight = rows["weight"] * a
    if weight.size == 0:
        return None
    weight = weight / rows["weight"].max()
    z = flow_z(rows, weight, least)
    return sidak(2 * stats.norm.sf(np.abs(z))) if z.size > 0 else None
