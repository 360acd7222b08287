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

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from scipy import stats

from support.rendering import build
from support.scenes import GREY, HEIGHT, SCENES, WHITE, WIDTH, picture_of, sky
from support.shapes import box, facing, floor, orthographic, perspective, quad, sphere, translate
from support.statistics import sidak
from usdmlt import _core
from usdmlt import scene as s

MUTATIONS = ("new_path", "bidirectional", "lens", "caustic", "multi_chain", "lens_subpath")

CLASS_SCENES: dict[str, Callable[[], s.Scene]] = {}


def class_scene(function: Callable[[], s.Scene]) -> Callable[[], s.Scene]:
    CLASS_SCENES[function.__name__] = function
    return function


GLASS = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))
WATER = s.Material(s.Dielectric(1.33, 0.0, scatter_mode="RT"))
MIRROR = s.Material(s.Conductor((0.2, 0.4, 1.4), (3.4, 2.3, 1.8), 0.0))
# Below Dirac reflection, so that a walk's stop is a matter of chance.
LACQUER = s.Material(s.Layer(s.Dielectric(1.8, 0.0), s.Diffuse((0.6, 0.5, 0.4))))


@class_scene
def corridor() -> s.Scene:
    """Diffuse walls from 0.7 to 9 units away under a lamp close to one of them: edges of all
    lengths and cosines, no Dirac vertex."""
    return picture_of(
        perspective((0, 0.6, 4), (-0.2, 0.4, 0), 62),
        meshes=[
            quad((-2, 0, 4.5), (4, 0, 0), (0, 0, -9.5), 0),
            quad((-1.2, 0, 4.5), (0, 0, -9.5), (0, 2.5, 0), 1),
            quad((2, -0.2, -5), (-0.8, 0, 8.5), (0, 2.8, 0), 0),
            quad((-2, 0, -5), (4, 0, 0), (0, 2.5, 0.6), 1),
            box((0.2, 0.0, 1.6), (0.7, 0.5, 2.2), 1),
        ],
        materials=[WHITE, GREY],
        lights=[s.RectLight((9, 8, 7), 0.5, 0.8, facing((-1.0, 0.9, 0.5), (0.6, 0.2, 0)))],
    )


def water(camera: s.Camera, lights: list, **others: object) -> s.Scene:
    """A sheet of water over a floor that falls from 0.15 to 2.5 units below it."""
    return picture_of(
        camera,
        meshes=[
            quad((-2.5, -0.15, 2.2), (5, 0, 0), (0, -2.35, -4.4), 0),
            quad((-2.5, 0, 2.2), (5, 0, 0), (0, 0, -4.4), 1),
            *others.pop("meshes", []),
        ],
        materials=[WHITE, WATER, *others.pop("materials", [])],
        lights=lights,
        **others,
    )


POOL_LAMP = s.RectLight((4, 4, 4), 2.2, 2.2, facing((0.6, 2.4, -0.5), (0, 0, 0), (0, 0, 1)))


@class_scene
def pool() -> s.Scene:
    """L S D S E under an area light, the floor at depths that differ 16 times."""
    return water(perspective((0, 1.3, 3.2), (0, -0.3, 0.4), 40), [POOL_LAMP])


@class_scene
def pool_through_a_lens() -> s.Scene:
    """The same seen by a wide lens, lit by a mesh that emits."""
    lamp = s.Material(s.UniformEmission((4, 4, 4)))
    camera = perspective((0, 1.3, 3.2), (0, -0.3, 0.4), 40, lens_radius=0.3, focus_distance=3.0)
    return water(
        camera,
        [],
        meshes=[quad((-0.6, 2.0, -1.4), (2.2, 0.5, 0), (0, 0.2, 2.0), 2)],
        materials=[lamp],
    )


@class_scene
def pool_from_afar() -> s.Scene:
    """The same seen by an orthographic camera, under a dome and a wide sun."""
    return water(
        orthographic((1.5, 2.5, 3), (0, -0.3, 0), 3.0),
        [
            s.DomeLight((0.5, 0.6, 0.8), 0),
            s.DistantLight((30, 26, 20), 14.0, facing((0, 0, 0), (-0.6, -2, -0.5))),
        ],
        textures=[s.Texture(sky())],
    )


@class_scene
def mirrors_and_floor() -> s.Scene:
    """E D S+ L, E D S D L and E S D S D L: inner chains at a mirror and a glass block, whose
    distances from the floor differ."""
    return picture_of(
        perspective((0, 1.6, 4.2), (0, 0.3, 0), 40),
        meshes=[
            floor(0, 2.5),
            quad((-1.8, 0.1, -0.6), (1.6, 0, -0.4), (0, 1.5, -0.5), 1),
            box((0.3, 0.25, -0.4), (1.5, 0.5, 0.6), 2),
            quad((-0.4, 0.02, 0.9), (1.2, 0, 0), (0, 0.2, -0.9), 3),
        ],
        materials=[WHITE, MIRROR, GLASS, LACQUER],
        lights=[s.RectLight((5, 5, 5), 1.8, 1.4, facing((0.5, 2.6, 1.0), (0, 0, 0)))],
    )


@class_scene
def sun_caustics() -> s.Scene:
    """L S D E of a sun without extent and of a wide one, by a tilted mirror and a glass block;
    edges from the mirror to the floor differ 5 times."""
    return picture_of(
        perspective((0, 2.4, 3.4), (0, 0, 0.2), 40),
        meshes=[
            floor(0, 2.5),
            quad((-1.9, 0.2, 0.6), (0, 0, -1.4), (0.7, 1.3, 0), 1),
            box((0.3, 0.3, -0.5), (1.4, 0.6, 0.7), 2),
        ],
        materials=[WHITE, MIRROR, GLASS],
        lights=[
            s.DistantLight((2.5, 2.4, 2.2), 0.0, facing((0, 0, 0), (-1.2, -1, -0.1))),
            s.DistantLight((60, 50, 40), 8.0, facing((0, 0, 0), (-0.8, -1.3, 0.2))),
        ],
    )


@class_scene
def lamp_caustics() -> s.Scene:
    """L S D E and L D S D E of a small lamp close to a mirror and a glass ball, over a floor that
    is far on one side: angles of the caustic perturbation differ many times."""
    return picture_of(
        perspective((0, 2.2, 3.6), (0, 0, 0.2), 44),
        meshes=[
            quad((-2.5, 0.7, 2.5), (5, -2.4, 0), (0, 0, -5), 0),
            quad((-0.2, 1.5, -0.7), (1.2, 0.25, 0), (0, 0, 1.4), 1),
            sphere(0.45, 2, smooth=True, transform=translate(-1.0, 1.0, 0.2)),
        ],
        materials=[WHITE, MIRROR, GLASS],
        lights=[s.DiskLight((9, 9, 9), 0.25, facing((0.1, 0.8, 0), (0.2, 1.6, 0), (0, 0, 1))),
                s.RectLight((6, 6, 6), 0.7, 0.7, facing((-1.3, 2.2, 0), (-1, 1, 0.2), (0, 0, 1)))],
    )  # fmt: skip


@class_scene
def veils() -> s.Scene:
    """Sheets of partial opacity, one of which emits, over a floor."""
    return picture_of(
        perspective((0, 1.5, 4), (0, 0.4, 0), 42),
        meshes=[
            floor(0, 2.5),
            quad((-1.5, 0.3, 0.8), (1.8, 0, -0.3), (0, 0.9, -0.5), 1),
            quad((-0.2, 0.9, -0.6), (1.5, 0.3, 0), (0, 0.1, 1.4), 2),
        ],
        materials=[
            WHITE,
            s.Material(s.Diffuse((0.7, 0.6, 0.6)), opacity=0.3),
            s.Material(s.Add(s.Diffuse((0.6, 0.6, 0.6)), s.UniformEmission((2, 2, 2))),
                       opacity=0.5),
        ],
        lights=[s.RectLight((8, 8, 8), 0.8, 0.8, facing((0.8, 2.2, 0.8), (0, 0, 0)))],
    )  # fmt: skip


@class_scene
def near_lamps() -> s.Scene:
    """Large lamps close to a floor, sampled by the solid angle they fill: points of one lamp are
    found with very different densities from different places."""
    return picture_of(
        perspective((0, 1.6, 4), (0, 0.2, 0), 44),
        meshes=[floor(0, 2.5), box((-0.4, 0, -0.6), (0.4, 0.5, 0), 1)],
        materials=[WHITE, GREY],
        lights=[
            s.SphereLight((3, 3, 3), 0.7, translate(-1.4, 0.85, 0.3)),
            s.RectLight((3, 3, 2), 1.6, 1.6, facing((1.5, 0.5, 0.2), (0.6, 0.2, 0))),
        ],
    )


@class_scene
def mirrored_light() -> s.Scene:
    """L D S D E: a lamp lights a panel, and only a mirror shows that to the floor, which falls away
    from it; the chain from the floor ends on the panel and is connected to the lamp."""
    return picture_of(
        perspective((0, 0.9, 3.8), (0, -0.3, 0), 46),
        meshes=[
            quad((-2.2, 0.2, 1.6), (4.4, -1.6, 0), (0, 0, -3.2), 0),
            quad((-2.3, 1.0, 1.0), (1.5, 0, 0), (0, 0, -2.0), 1),
            quad((-2.4, 2.3, -1.4), (4.0, 0.5, 0), (0, 0, 2.8), 2),
        ],
        materials=[WHITE, s.Material(s.Diffuse((0.8, 0.7, 0.6))), MIRROR],
        lights=[s.RectLight((40, 40, 40), 0.3, 0.3,
                            facing((-1.6, 1.5, 0.2), (-1.6, 1.0, 0.1), (0, 0, 1)))],
    )  # fmt: skip


def build_scene(name: str):
    return build((CLASS_SCENES | SCENES)[name]())


# ---- Steps ------------------------------------------------------------------------------------


def class_name(key: float) -> str:
    """L, then D or S for every vertex between, then E."""
    bits, name = int(key), "L"
    while bits > 1:
        name += "DS"[bits & 1]
        bits >>= 1
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
    """z of the sum of flow in every cell. Left out are cells whose flow in, or out, comes from
    fewer than ``least`` clusters, by (Σd)²/Σd²: their sums are not normal. (What flows out as many
    small parts may flow in as few large ones, which most seeds then miss.)"""
    if cell.size == 0:
        return np.empty(0)
    cells = int(cell.max()) + 1
    _, index = np.unique(cluster, return_inverse=True)
    pairs, where = np.unique(index * cells + cell, return_inverse=True)
    cell = pairs % cells

    def sums(flow: np.ndarray, power: int) -> np.ndarray:
        return np.bincount(cell, np.bincount(where, flow) ** power, cells)

    with np.errstate(divide="ignore", invalid="ignore"):
        z = sums(flow, 1) / np.sqrt(sums(flow, 2))
        carried = [sums(f, 1) ** 2 / sums(f, 2) for f in (np.maximum(flow, 0), np.minimum(flow, 0))]
    return z[np.minimum(*carried) >= least]


def flow_z(rows: Mapping, weight: np.ndarray, least: float) -> np.ndarray:
    """z of the net flow into all cells of all partitions, and of the change of all functions, over
    all steps and over those within one class (pairs of states may be restricted symmetrically)."""
    z = []
    cluster = rows["cluster"]
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
    weight = weight / max(weight.max(), 1e-300)
    z = flow_z(rows, weight, least)
    return sidak(2 * stats.norm.sf(np.abs(z))) if z.size > 0 else None
