"""Media of a scene description: how hot ones glow, and checks, for the core trusts its input."""

from __future__ import annotations

import numpy as np

from usdmlt import color
from usdmlt.scene import Grid, Medium, Mesh, Scene, Volume

PHASES = ("henyey_greenstein", "rayleigh")
# Points that are this close, of the size of a mesh, may be one: exporters round what they split.
SAME_POINT = 1e-5
COEFFICIENTS = ("scattering", "absorption", "emission")
REFERENCE = 2000.0  # kelvin
DARK = 500.0  # kelvin, below which nothing is seen
HOTTEST = 1e6
TEMPERATURES = 256  # of the table of colours


def blackbody_emission(kelvin: np.ndarray, space: str = color.DEFAULT) -> np.ndarray:
    """(..., 3) radiance of blackbodies by Planck's law, linear in a colour space, of luminance 1 at
    2000 kelvin; 0 below 500. ``kelvin`` is of any shape. For :attr:`usdmlt.scene.Grid.emission`.
    """
    hot = kelvin >= DARK
    if not hot.any():
        return np.zeros((*kelvin.shape, 3))
    low, high = kelvin[hot].min(), min(kelvin.max(), HOTTEST)
    table = np.geomspace(min(low, high), high, TEMPERATURES if high > low else 1)
    luminance = color.blackbody_radiance(REFERENCE).sum() / color.blackbody(REFERENCE).sum()
    colors = np.array([color.blackbody_radiance(t, space) for t in table]) / luminance
    # Radiance rises steeply: between temperatures its logarithm is all but linear in that of them.
    logs = np.log(np.maximum(colors, 1e-30))
    at = np.log(np.clip(kelvin, table[0], table[-1]))
    glow = np.stack([np.exp(np.interp(at, np.log(table), column)) for column in logs.T], axis=-1)
    return np.where(hot[..., None], glow, 0.0)


def check_media(scene: Scene) -> None:
    """Raise ValueError, naming the medium or the mesh, for media that cannot be.

    Coefficients are finite and at least 0, |anisotropy| is below 1, grids are whole, indices are
    those of :attr:`Scene.media`, and what holds a medium is closed.
    """
    for index, medium in enumerate(scene.media):
        try:
            _check_medium(medium)
        except (TypeError, ValueError) as error:
            raise ValueError(f"medium '{medium.name or index}': {error}") from None
    meshes = [*scene.meshes, *(mesh for p in scene.prototypes for mesh in p.meshes)]
    _check_index(scene, "the world", scene.world_medium)
    bodies: list[Mesh | Volume] = [mesh for mesh in meshes if mesh.medium is not None]
    for body in bodies + list(scene.volumes):
        name = f"{type(body).__name__.lower()} '{body.name}'"
        _check_index(scene, name, body.medium)
        if not is_closed(body):
            raise ValueError(f"{name} holds a medium and is not closed")


def _check_index(scene: Scene, name: str, number: int | None) -> None:
    if number is not None and not 0 <= number < len(scene.media):
        raise ValueError(f"{name} holds medium {number}, of {len(scene.media)}")


def _check_medium(medium: Medium) -> None:
    for name in COEFFICIENTS:
        check_coefficient(name, getattr(medium, name))
    if medium.phase not in PHASES:
        raise ValueError(f"phase {medium.phase!r} is none of {', '.join(PHASES)}")
    check_anisotropy(medium.anisotropy)
    if medium.grid is not None:
        check_grid(medium.grid)


def check_coefficient(name: str, value: object) -> None:
    """Raise ValueError unless it is three finite numbers of at least 0."""
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.shape != (3,):
        raise ValueError(f"{name} is {value!r}, not three numbers")
    if not (np.isfinite(numbers).all() and (numbers >= 0).all()):
        raise ValueError(f"{name} is {plain(numbers)}; it must be finite and at least 0")


def check_anisotropy(value: float) -> None:
    """Raise ValueError unless it is a mean cosine that a phase function can have."""
    if not -1 < value < 1:
        raise ValueError(f"anisotropy is {value:g}; it must be between -1 and 1")


def check_grid(grid: Grid) -> None:
    """Raise ValueError for shapes that do not fit each other, values that are not finite or below
    0, and boxes without volume."""
    values = np.asarray(grid.values)
    _check_values("the grid", values, "(nx, ny, nz)", 3)
    if grid.emission is not None:
        emission = np.asarray(grid.emission)
        _check_values("the grid's emission", emission, "(nx, ny, nz, 3)", 4)
        if emission.shape != (*values.shape, 3):
            raise ValueError(
                f"the grid's emission is {emission.shape}, which does not fit {values.shape}"
            )
    corners = np.array([grid.lower, grid.upper], dtype=np.float64)
    if not (np.isfinite(corners).all() and (corners[0] < corners[1]).all()):
        raise ValueError(f"the grid's box from {grid.lower} to {grid.upper} has no volume")
    linear = np.asarray(grid.transform, dtype=np.float64)
    if linear.shape != (4, 4) or not np.isfinite(linear).all() or not np.linalg.det(linear):
        raise ValueError("the grid's transform is singular")


def _check_values(name: str, values: np.ndarray, shape: str, dimensions: int) -> None:
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{name} holds {values.dtype}, not numbers")
    if values.ndim != dimensions or values.size == 0:
        raise ValueError(f"{name} is {values.shape}, not {shape}")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} has values that are not finite")
    if values.min() < 0:
        raise ValueError(f"{name} has values below 0, down to {values.min():g}")


def is_closed(mesh: Mesh | Volume) -> bool:
    """Whether an even number of triangles, two as a rule, meet at every edge.

    Points count by where they are: exporters split vertices.
    """
    points = np.asarray(mesh.points, dtype=np.float64)
    if _all_edges_are_shared(mesh, points):
        return True
    size = np.ptp(points, axis=0).max() * SAME_POINT
    if not size > 0:
        return False
    # Points on either side of a cell's border are apart: other borders may tell.
    return any(_all_edges_are_shared(mesh, np.round(points / size + s)) for s in (0.0, 0.25, 0.5))


def _all_edges_are_shared(mesh: Mesh | Volume, points: np.ndarray) -> bool:
    unique, vertex = np.unique(points + 0.0, axis=0, return_inverse=True)  # -0 is 0
    triangles = vertex.ravel()[mesh.triangles]
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, counts = np.unique(edges @ (len(unique), 1), return_counts=True)
    return bool(len(counts)) and not (counts % 2).any()


def plain(numbers: np.ndarray) -> tuple[float, ...]:
    """Numbers as they are written."""
    return tuple(float(number) for number in numbers)
