"""What the tests of lights share: placements, parametrised surfaces, and goodness of fit.

Every surface family is described here a second time, in double precision and from its definition
alone, so that the core's samples and densities are compared with something independent of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from usdmlt import _core, scene

# Each statistical test may fail by chance with this probability; seeds are fixed.
SIGNIFICANCE = 1e-4


def placement(rotation=(0.0, 0.0, 0.0), scale=(1.0, 1.0, 1.0), shear=0.0, position=(0.0, 0.0, 0.0)):
    """A row-vector matrix: shear, then scale, then rotate (Euler angles, radians), then move."""
    matrix = np.eye(4)
    sheared = np.eye(3)
    sheared[1, 0] = sheared[2, 1] = shear
    matrix[:3, :3] = sheared @ np.diag(scale) @ Rotation.from_euler("xyz", rotation).as_matrix().T
    matrix[3, :3] = position
    return matrix


PLACEMENTS = {
    "rigid": placement((0.3, -0.8, 2.0), position=(1.0, 2.0, -0.5)),
    "stretched": placement((1.0, 0.4, 0.1), (3.0, 0.7, 1.4), position=(-2.0, 0.0, 1.0)),
    "sheared": placement((-0.5, 0.2, 0.7), (1.0, 1.5, 0.6), 0.6, (0.0, 0.5, 3.0)),
    "mirrored": placement((0.2, 2.0, 0.3), (-1.0, 1.3, 1.0), 0.2, (0.5, -1.0, 0.0)),
}


@dataclass
class Surface:
    """A light's surface, parametrised over (a, b) in the unit square.

    ``local(a, b)``: position before the light's transform; ``uv(a, b)``: the core's parameters;
    ``ab(uv)``: back again; ``outward(a, b)``: the emitting side before the transform.
    """

    light: scene.Light
    local: Callable
    uv: Callable
    ab: Callable
    outward: Callable

    def world(self, a, b):
        return self.local(a, b) @ self.light.transform[:3, :3] + self.light.transform[3, :3]

    def normal(self, a, b):
        """The emitting side's unit normal: normals transform by the inverse transpose."""
        n = self.outward(a, b) @ np.linalg.inv(self.light.transform[:3, :3]).T
        return n / np.linalg.norm(n, axis=1, keepdims=True)

    def area_element(self, a, b, step=1e-6):
        """World area per unit of (a, b), by central differences."""
        along_a = (self.world(a + step, b) - self.world(a - step, b)) / (2 * step)
        along_b = (self.world(a, b + step) - self.world(a, b - step)) / (2 * step)
        return np.linalg.norm(np.cross(along_a, along_b), axis=1)

    def masses(self, density, cells=(16, 16), order=8):
        """∫ density dA over each cell of a grid on (a, b); ``density(uv)`` is per world area."""
        x, weights = np.polynomial.legendre.leggauss(order)
        a = ((np.arange(cells[0])[:, None] + 0.5 * (x + 1)) / cells[0]).ravel()
        b = ((np.arange(cells[1])[:, None] + 0.5 * (x + 1)) / cells[1]).ravel()
        aa, bb = (g.ravel() for g in np.meshgrid(a, b, indexing="ij"))
        values = density(self.uv(aa, bb)) * self.area_element(aa, bb)
        values = values.reshape(cells[0], order, cells[1], order)
        return np.einsum("ikjl,k,l->ij", values, weights, weights) / (4 * cells[0] * cells[1])

    def counts(self, uv, cells=(16, 16)):
        a, b = self.ab(np.asarray(uv, np.float64))
        return np.histogram2d(a, b, bins=cells, range=((0, 1), (0, 1)))[0]


@dataclass
class DirectionGrid:
    """Cells of equal θ and φ about ``axis``, for distributions of directions.

    With 10-degree steps in θ, cones of such angles end at borders of cells.
    """

    axis: np.ndarray
    cells: tuple[int, int] = (36, 12)

    def frame(self):
        z = np.asarray(self.axis, float) / np.linalg.norm(self.axis)
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])

    def masses(self, density, order=12):
        """∫ density dω over each cell by midpoints; ``density(directions)`` is per solid angle."""
        theta = np.pi * (np.arange(self.cells[0] * order) + 0.5) / (self.cells[0] * order)
        phi = 2 * np.pi * (np.arange(self.cells[1] * order) + 0.5) / (self.cells[1] * order)
        tt, pp = (g.ravel() for g in np.meshgrid(theta, phi, indexing="ij"))
        local = np.stack([np.sin(tt) * np.cos(pp), np.sin(tt) * np.sin(pp), np.cos(tt)], 1)
        # ∫ sinθ dθ over each row of midpoints, exactly.
        edges = np.cos(np.linspace(0, np.pi, self.cells[0] * order + 1))
        solid_angle = np.repeat(edges[:-1] - edges[1:], len(phi)) * 2 * np.pi / len(phi)
        values = density((local @ self.frame()).astype(np.float32)) * solid_angle
        return values.reshape(self.cells[0], order, self.cells[1], order).sum((1, 3))

    def counts(self, directions):
        x, y, z = self.frame() @ np.asarray(directions, float).T
        theta, phi = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x) % (2 * np.pi)
        ranges = ((0, np.pi), (0, 2 * np.pi))
        return np.histogram2d(theta, phi, bins=self.cells, range=ranges)[0]


def _circle(b):
    return np.cos(2 * np.pi * b), np.sin(2 * np.pi * b)


def _turns(y, x):
    return np.arctan2(y, x) / (2 * np.pi) % 1.0


def _unit_sphere(a, b):
    c, s = _circle(b)
    z = 1 - 2 * a
    r = np.sqrt(np.maximum(1 - z * z, 0))
    return np.stack([r * c, r * s, z], 1)


def _fold(x, y):
    return (1 - np.abs(y)) * np.copysign(1, x), (1 - np.abs(x)) * np.copysign(1, y)


def _octahedral(n):
    x, y, z = (n / np.abs(n).sum(1, keepdims=True)).T
    fx, fy = _fold(x, y)
    return np.stack([np.where(z < 0, fx, x), np.where(z < 0, fy, y)], 1)


def _from_octahedral(uv):
    x, y = uv.T
    z = 1 - np.abs(x) - np.abs(y)
    fx, fy = _fold(x, y)
    n = np.stack([np.where(z < 0, fx, x), np.where(z < 0, fy, y), z], 1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return (1 - n[:, 2]) / 2, _turns(n[:, 1], n[:, 0])


def _down(a, b):
    return np.broadcast_to([0.0, 0.0, -1.0], (len(a), 3))


def rect(transform, radiance=(1.0, 1.0, 1.0), width=1.5, height=0.8, **more):
    return Surface(
        scene.RectLight(radiance, width, height, transform, **more),
        lambda a, b: np.stack([(a - 0.5) * width, (b - 0.5) * height, 0 * a], 1),
        lambda a, b: np.stack([a, b], 1),
        lambda uv: (uv[:, 0], uv[:, 1]),
        _down,
    )


def disk(transform, radiance=(1.0, 1.0, 1.0), radius=0.7, **more):
    def unit(a, b):
        c, s = _circle(b)
        return a * c, a * s

    return Surface(
        scene.DiskLight(radiance, radius, transform, **more),
        lambda a, b: np.stack([radius * unit(a, b)[0], radius * unit(a, b)[1], 0 * a], 1),
        lambda a, b: np.stack(unit(a, b), 1),
        lambda uv: (np.hypot(uv[:, 0], uv[:, 1]), _turns(uv[:, 1], uv[:, 0])),
        _down,
    )


def sphere(transform, radiance=(1.0, 1.0, 1.0), radius=0.6, **more):
    return Surface(
        scene.SphereLight(radiance, radius, transform, **more),
        lambda a, b: radius * _unit_sphere(a, b),
        lambda a, b: _octahedral(_unit_sphere(a, b)),
        _from_octahedral,
        _unit_sphere,
    )


def cylinder(transform, radiance=(1.0, 1.0, 1.0), radius=0.4, length=1.7, **more):
    return Surface(
        scene.CylinderLight(radiance, radius, length, transform, **more),
        lambda a, b: np.stack([(a - 0.5) * length, *(radius * x for x in _circle(b))], 1),
        lambda a, b: np.stack([a, b], 1),
        lambda uv: (uv[:, 0], uv[:, 1]),
        lambda a, b: np.stack([0 * a, *_circle(b)], 1),
    )


FAMILIES = {"rect": rect, "disk": disk, "sphere": sphere, "cylinder": cylinder}


@pytest.fixture(params=FAMILIES)
def family(request):
    """A function that makes the :class:`Surface` of a family: ``family(transform, ...)``."""
    return FAMILIES[request.param]


@pytest.fixture(params=PLACEMENTS)
def transform(request):
    return PLACEMENTS[request.param]


@pytest.fixture
def surface(family, transform):
    return family(transform)


@pytest.fixture(scope="session")
def families():
    return FAMILIES


@pytest.fixture(scope="session")
def placed():
    return placement


@pytest.fixture(scope="session")
def direction_grid():
    return DirectionGrid


@pytest.fixture(scope="session")
def probe():
    """``probe(*lights, ...)``: a LightsProbe of lights or surfaces."""

    def make(*lights, **more):
        lights = [light.light if isinstance(light, Surface) else light for light in lights]
        return _core.LightsProbe(lights, **more)

    return make


@pytest.fixture
def uniform():
    """``uniform(n, width)``: float32 numbers in [0, 1) from a fixed seed."""
    generator = np.random.default_rng(20240601)
    return lambda n, width=3: generator.random((n, width), dtype=np.float32)


@pytest.fixture(scope="session")
def assert_distributed_as():
    """``(counts, masses, drawn)``: the histogram of ``drawn`` samples has these probabilities.

    What the masses, which are integrals good to ``accuracy``, lack to 1 is the probability of no
    sample. Their sum is compared first, then the distribution over the cells by a χ² test; cells
    that expect fewer than ten samples are pooled. It could miss errors confined to regions much
    smaller than a cell.
    """

    def check(counts, masses, drawn, accuracy=2e-3):
        counts, masses = np.ravel(counts), np.ravel(masses)
        found = counts.sum() / drawn
        error = np.sqrt(found * (1 - found) / drawn)
        assert masses.sum() == pytest.approx(found, abs=accuracy + 4 * error)
        expected = masses * counts.sum() / masses.sum()
        small = expected < 10
        rare, rarely = counts[small].sum(), expected[small].sum()
        assert rare <= stats.poisson.isf(SIGNIFICANCE, rarely + 1e-4 * drawn)
        counts, expected = counts[~small], expected[~small]
        statistic = ((counts - expected) ** 2 / expected).sum()
        p = stats.chi2.sf(statistic, max(len(expected) - 1, 1))
        assert p > SIGNIFICANCE, f"χ² = {statistic:.1f} for {len(expected)} cells, p = {p:.2g}"

    return check


@pytest.fixture(scope="session")
def assert_mean():
    """``(samples, expected)``: means over the first axis, within four standard errors."""

    def check(samples, expected):
        samples = np.asarray(samples, np.float64)
        error = samples.std(0) / np.sqrt(len(samples))
        assert np.all(np.abs(samples.mean(0) - expected) <= 4 * error + 1e-6 * np.abs(expected)), (
            f"mean {samples.mean(0)} ± {error}, expected {expected}"
        )

    return check
