"""Grids of floats in OpenVDB files, by the package tinyvdb (an optional extra).

Read are the voxels that are active in the leaves of a tree; others are 0. Not read: trees
of other types than float, regions of one value that are kept as a tile of a tree, frustums, and
NanoVDB's files.
"""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np

MISSING = "OpenVDB files need the tinyvdb package (pip install 'usdmlt[vdb]')"
MOST_CELLS = 1 << 28
TYPE = "Tree_float_5_4_3"


class Unreadable(Exception):
    """A file or a grid that is not read, and why."""


def is_installed() -> bool:
    """Whether OpenVDB files can be read at all."""
    return importlib.util.find_spec("tinyvdb") is not None


def read_grid(data: bytes, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The grid of a name in a file: values (nx, ny, nz) float32 of the box that holds all active
    voxels, the index (3,) of its first voxel, and the transform (4, 4) from indices, which are the
    middles of voxels, to the file's space. Raises :class:`Unreadable`."""
    import tinyvdb

    try:
        with tinyvdb.from_bytes(data) as file:
            names = [str(file.grid_name(i)) for i in range(file.grid_count)]
            if name not in names:
                raise Unreadable(f"the file has no grid {name!r}, but {', '.join(names)}")
            index = names.index(name)
            kind = str(file.grid_type_name(index))
            if kind.removesuffix("_HalfFloat") != TYPE:
                raise Unreadable(f"the grid {name!r} is a {kind}, not of floats")
            file.read_grids()
            grid = file.grid(index)
            voxels, transform, metadata = grid.to_sparse(), grid.transform, grid.metadata
    except tinyvdb.VDBError as error:
        raise Unreadable(str(error)) from None
    at = np.frombuffer(voxels["coords"], np.int32).reshape(-1, 3)
    count = metadata.get("file_voxel_count")
    if count is not None and count != len(at):
        raise Unreadable(f"the grid {name!r} has tiles of one value")
    if not len(at):
        raise Unreadable(f"the grid {name!r} is empty")
    first = at.min(axis=0).astype(np.int64)
    shape = at.max(axis=0) - first + 1
    if np.prod(shape) > MOST_CELLS:
        raise Unreadable(f"the grid {name!r} has {' x '.join(map(str, shape))} voxels")
    values = np.zeros(shape, np.float32)
    values[tuple((at - first).T)] = np.frombuffer(voxels["values"], np.float32)
    return values, first, _to_file(transform)


def _to_file(transform: dict[str, Any]) -> np.ndarray:
    """From indices to the file's space, acting on row vectors as OpenVDB's own matrices do."""
    kind = transform["type"]
    if "frustum" in kind:
        raise Unreadable("frustums are not read")
    if kind == "affine":
        matrix = np.array(transform["matrix"], dtype=np.float64)
        # Some writers have it the other way round.
        unit = np.array([0.0, 0.0, 0.0, 1.0])
        return matrix if np.array_equal(matrix[:, 3], unit) else matrix.T
    matrix = np.eye(4)
    scale = np.array(transform["scale"], dtype=np.float64)
    matrix[:3, :3] = np.diag(np.where(scale == 0, 1.0, scale))
    matrix[3, :3] = transform["translation"]
    return matrix
