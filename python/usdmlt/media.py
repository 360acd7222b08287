"""Media of a scene description, checked before the core takes them: it trusts what it is given."""

from __future__ import annotations

import numpy as np

from usdmlt.scene import Grid, Medium, Scene

PHASES = ("henyey_greenstein", "rayleigh")
COEFFICIENTS = ("scattering", "absorption", "emission")


def check_media(scene: Scene) -> None:
    """Raise ValueError, naming the medium or the mesh, for media that cannot be.

    Coefficients are finite and at least 0, |anisotropy| is below 1, grids are whole, and indices
    are those of :attr:`Scene.media`.
    """
    for index, medium in enumerate(scene.media):
        try:
            _check_medium(medium)
        except (TypeError, ValueError) as error:
            raise ValueError(f"medium '{medium.name or index}': {error}") from None
    meshes = [*scene.meshes, *(mesh for p in scene.prototypes for mesh in p.meshes)]
    used: list[tuple[str, int | None]] = [("the world", scene.world_medium)]
    used += [(f"mesh '{mesh.name}'", mesh.medium) for mesh in meshes]
    used += [(f"volume '{volume.name}'", volume.medium) for volume in scene.volumes]
    for name, number in used:
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


def plain(numbers: np.ndarray) -> tuple[float, ...]:
    """Numbers as they are written."""
    return tuple(float(number) for number in numbers)
