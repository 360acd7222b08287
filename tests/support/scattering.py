"""Closures of materials at a point, integrals over the sphere, and χ² tests of samplers.

Directions are float64 arrays (3,) or (n, 3); the surface's normal is +z unless told otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import stats

from usdmlt import closures, scene
from usdmlt.native import core

NON_DELTA = 0


def delta_reflection(lobe: int) -> int:
    """The component of the Dirac reflection of a lobe."""
    return 1 + 2 * lobe


def delta_transmission(lobe: int) -> int:
    """The component of the Dirac refraction of a lobe."""
    return 2 + 2 * lobe


def probe_material(
    material: scene.Material,
    textures: list[scene.Texture] | None = None,
    primvars: dict[str, np.ndarray] | None = None,
    **where: object,
):
    """The core's closure of a material. ``primvars``: by name, values at the three corners."""
    textures = textures or []
    description = scene.Scene(materials=[material], textures=textures)
    compiled, slots = closures.compile_materials(description)
    values = {
        slots[name]: np.asarray(v, np.float32)
        for name, v in (primvars or {}).items()
        if name in slots
    }
    return core().ClosureProbe(textures, compiled[0], primvars=values, **where)


def probe(closure: scene.Closure | None, **where: object):
    """The core's closure of a material that is nothing but a closure."""
    return probe_material(scene.Material(closure, name="probed"), **where)


def polar(cosine: float, azimuth: float = 0.0) -> np.ndarray:
    """The unit vector of a cosine to +z and an azimuth in radians."""
    sine = np.sqrt(max(0.0, 1 - cosine**2))
    return np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])


def rows(direction: np.ndarray, n: int) -> np.ndarray:
    """``direction`` n times."""
    return np.broadcast_to(np.asarray(direction, np.float64), (n, 3))


def random_directions(n: int, seed: int) -> np.ndarray:
    """Uniform on the sphere, unit in float32 as well as float32 can."""
    v = np.random.default_rng(seed).normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def mirrored(w: np.ndarray) -> np.ndarray:
    """The mirror direction at the plane z = 0."""
    return np.array([-w[0], -w[1], w[2]])


def refracted(w: np.ndarray, eta: float) -> np.ndarray | None:
    """Where ``w`` refracts, with index ``eta`` below z = 0; None if there is none."""
    m = eta if w[2] > 0 else 1 / eta
    sine2 = (1 - w[2] ** 2) / m**2
    if sine2 >= 1:
        return None
    return np.array([-w[0] / m, -w[1] / m, -np.sign(w[2]) * np.sqrt(1 - sine2)])


class SphereGrid:
    """The sphere in ``bins`` x ``bins`` cells about an axis, each with ``sub`` x ``sub`` midpoints.

    The polar angle is θ(x) = π (e^{kx} − 1) / (e^k − 1), k the ``concentration``: cells become
    small at the axis, which narrow lobes need.
    """

    def __init__(self, axis, concentration: float = 0.0, bins: int = 16, sub: int = 16) -> None:
        axis = np.asarray(axis, np.float64) / np.linalg.norm(axis)
        x = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
        x /= np.linalg.norm(x)
        self.frame = np.stack([x, np.cross(axis, x), axis])
        self.k, self.bins, self.sub = concentration, bins, sub
        n = bins * sub
        cosines = np.cos(self._theta(np.arange(n + 1) / n))
        theta = self._theta((np.arange(n) + 0.5) / n)
        phi = (np.arange(n) + 0.5) / n * 2 * np.pi - np.pi
        t, p = (m.ravel() for m in np.meshgrid(theta, phi, indexing="ij"))
        local = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
        self.directions = local @ self.frame
        self.solid_angles = np.repeat((cosines[:-1] - cosines[1:]) * (2 * np.pi / n), n)

    def _theta(self, x: np.ndarray) -> np.ndarray:
        return np.pi * (np.expm1(self.k * x) / np.expm1(self.k) if self.k > 0 else x)

    def cells(self, directions: np.ndarray) -> np.ndarray:
        """Index of the cell of each direction."""
        local = directions @ self.frame.T
        x = np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2]) / np.pi
        if self.k > 0:
            x = np.log1p(x * np.expm1(self.k)) / self.k
        y = (np.arctan2(local[:, 1], local[:, 0]) + np.pi) / (2 * np.pi)
        i, j = (np.clip((v * self.bins).astype(int), 0, self.bins - 1) for v in (x, y))
        return i * self.bins + j

    def per_cell(self, values: np.ndarray) -> np.ndarray:
        """Integrals of (n,) values at the midpoints over each cell."""
        b, s = self.bins, self.sub
        return (values * self.solid_angles).reshape(b, s, b, s).sum(axis=(1, 3)).ravel()

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Integral of (n, …) values at the midpoints over the sphere."""
        return np.tensordot(self.solid_angles, values, axes=1)


@dataclass
class Samples:
    """Samples of a closure, given one direction."""

    directions: np.ndarray
    values: np.ndarray
    pdfs: np.ndarray
    components: np.ndarray
    valid: np.ndarray

    def throughput(self) -> np.ndarray:
        """value |cosθ_sampled| / pdf, (n, 3); 0 where nothing was scattered."""
        cosine = np.abs(self.directions[:, 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = self.values * (cosine / self.pdfs)[:, None]
        return np.where(self.valid[:, None], weight, 0.0)


def draw(closure, known: np.ndarray, role: str, n: int, seed: int = 1) -> Samples:
    """``n`` independent samples given ``known`` in the ``role`` of "eye" or "light"."""
    rng = np.random.default_rng(seed)
    directions, values, pdfs, components, valid = closure.sample(
        rows(known, n), role, rng.random(n), rng.random((n, 2))
    )
    as_double = (np.asarray(a, np.float64) for a in (directions, values, pdfs))
    return Samples(*as_double, components, valid)


def values_over(closure, known: np.ndarray, role: str, directions: np.ndarray) -> np.ndarray:
    """f |cosθ| for the known direction and each of the others, non-Dirac part, (n, 3)."""
    fixed = rows(known, len(directions))
    pair = (directions, fixed) if role == "eye" else (fixed, directions)
    return np.asarray(closure.evaluate(*pair), np.float64) * np.abs(directions[:, 2:])


@lru_cache(maxsize=128)
def _grid(axis: tuple[float, ...], concentration: float) -> SphereGrid:
    return SphereGrid(axis, concentration)


def grids_for(closure, known: np.ndarray) -> list[tuple[SphereGrid, bool]]:
    """Grids for the sides of the surface to which the closure scatters; True: the other side.

    About the normal for broad lobes, fine about their peak for narrow ones and for refraction.
    """
    lobes = closure.lobes
    glossy = [x for x in lobes if x["type"] not in ("diffuse", "eon", "translucent", "sheen")]
    alpha = min((min(x["alpha"]) for x in glossy if not x["delta"]), default=1.0)
    concentration = 0.5 - 1.3 * float(np.log(alpha))
    if alpha < 0.5:
        grids = [(_grid(tuple(mirrored(known)), concentration), False)]
    else:
        grids = [(_grid((0.0, 0.0, 1.0), 0.0), False)]
    eta = next((x["eta"] for x in glossy if x["transmits"] and not x["delta"]), None)
    if eta is not None:
        through = refracted(known, eta)
        if through is None:  # total reflection: what rough refraction there is grazes the surface
            through = known * [-1, -1, 0]
        grids.append((_grid(tuple(through), max(concentration, 2.0)), True))
    elif any(x["type"] == "translucent" for x in lobes):
        grids.append((_grid((0.0, 0.0, 1.0), 0.0), True))
    return grids


def one_side(directions: np.ndarray, known: np.ndarray, across: bool) -> np.ndarray:
    """Which directions are on the same side as ``known``, or on the other side (``across``)."""
    return (directions[:, 2] * known[2] < 0) == across


def albedo(closure, known: np.ndarray, role: str) -> np.ndarray:
    """∫ f |cosθ| dω over the direction that is not known, without Dirac parts, (3,)."""
    total = np.zeros(3)
    for grid, across in grids_for(closure, known):
        values = values_over(closure, known, role, grid.directions)
        total += grid.integral(values * one_side(grid.directions, known, across)[:, None])
    return total


@dataclass
class Fit:
    """How samples on one side of the surface compare with the density there."""

    p_value: float  # χ²
    integral: float  # of the density
    success: float  # share of the samples
    n: int


def fit_of_samples(closure, known: np.ndarray, grid: SphereGrid, across: bool, n: int) -> Fit:
    """Compare the non-Dirac samples of one side with the density that ``closure.pdf`` claims.

    All else (failures, Dirac components, the other side) is one more cell, with the probability
    that the density leaves.
    """
    s = draw(closure, known, "eye", n)
    pdf = closure.pdf(rows(known, len(grid.directions)), grid.directions, "eye")
    pdf = np.where(one_side(grid.directions, known, across), np.asarray(pdf, np.float64), 0.0)
    expected = n * grid.per_cell(pdf)
    integral = expected.sum() / n
    expected = np.append(expected, max(0.0, n - expected.sum()))
    hit = s.valid & (s.components == NON_DELTA) & one_side(s.directions, known, across)
    observed = np.bincount(grid.cells(s.directions[hit]), minlength=grid.bins**2)
    observed = np.append(observed, n - hit.sum())

    few = expected < 10  # cells where less is expected are put together
    e, o = expected[~few], observed[~few]
    rest_e, rest_o = expected[few].sum(), observed[few].sum()
    if rest_e >= 10:
        e, o = np.append(e, rest_e), np.append(o, rest_o)
    p = float(stats.chi2.sf(((o - e) ** 2 / e).sum(), max(len(e) - 1, 1)))
    if rest_e < 10 and stats.poisson.sf(rest_o - 1, rest_e + 0.1) < 1e-9:
        p = 0.0  # samples where there should be next to none
    return Fit(p, integral, hit.mean(), n)
