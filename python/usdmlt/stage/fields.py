"""Values of volumes from files: NumPy's .npy and .npz, and OpenVDB's .vdb.

A field is any prim with ``filePath`` and ``fieldName``, such as an OpenVDBAsset; what the file is,
its name says. ``fieldIndex`` does not count.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from zipfile import BadZipFile

import numpy as np
from pxr import Ar, Usd

from usdmlt.errors import Error, Report
from usdmlt.stage import vdb_files

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass
class Field:
    """``values`` as they are in the file. ``box``: lower and upper corner, None where nothing says;
    ``transform`` (4, 4): from the space of the box to that of the prim. ``first``: of an OpenVDB
    grid, the index of the first voxel."""

    values: np.ndarray
    box: Box | None
    transform: np.ndarray
    first: np.ndarray | None = None

    def like(self, other: Field) -> Field:
        """The voxels that another grid of the same file has; 0 where this one has none."""
        if self.first is None or other.first is None:
            return self
        if not np.array_equal(self.transform, other.transform):
            raise ValueError("grids of one volume have different voxels")
        values = np.zeros_like(other.values)
        low = np.maximum(self.first, other.first)
        high = np.minimum(self.first + self.values.shape, other.first + values.shape)
        if (low < high).all():
            values[_slices(low - other.first, high - other.first)] = self.values[
                _slices(low - self.first, high - self.first)
            ]
        return Field(values, other.box, other.transform, other.first)


def _slices(low: np.ndarray, high: np.ndarray) -> tuple[slice, ...]:
    return tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))


def read_field(prim: Usd.Prim, name: str, time: Usd.TimeCode, report: Report) -> Field | None:
    """The field of a prim, ``name`` what it is called where the prim does not say; None, with a
    warning, if it cannot be read."""
    attribute = prim.GetAttribute("filePath")
    asset = attribute.Get(time) if attribute else None
    if asset is None or not asset.path:
        report.warn("fields without a file", prim.GetPath())
        return None
    suffix = asset.path.rpartition(".")[2].lower()
    place = f"{prim.GetPath()} ({asset.path})"
    if suffix not in ("npy", "npz", "vdb"):
        report.warn("fields are read from .npy, .npz and .vdb files only", place)
        return None
    if suffix == "vdb" and not vdb_files.is_installed():
        report.warn(vdb_files.MISSING, place)
        return None
    content = None
    if asset.resolvedPath:
        content = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(asset.resolvedPath))
    if not content:
        report.warn("files of fields are missing", place)
        return None
    named = prim.GetAttribute("fieldName")
    name = str((named and named.Get(time)) or name)
    data = bytes(content.GetBuffer())
    if suffix == "vdb":
        return _vdb(data, name, place, report)
    try:
        values = _array(data, name)
    except (OSError, ValueError, EOFError, KeyError, BadZipFile) as reason:
        raise Error(f"{place}: {reason}") from None
    return Field(values, extent(prim, time), np.eye(4))


def _array(data: bytes, name: str) -> np.ndarray:
    """The array of a .npy file, or that of a name in a .npz file."""
    loaded = np.load(io.BytesIO(data), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return loaded
    if name not in loaded.files:
        raise ValueError(f"the file has no array {name!r}, but {', '.join(loaded.files)}")
    values: np.ndarray = loaded[name]
    return values


def _vdb(data: bytes, name: str, place: str, report: Report) -> Field | None:
    try:
        values, first, transform = vdb_files.read_grid(data, name)
    except vdb_files.Unreadable as reason:
        report.warn("OpenVDB files cannot be read", f"{place}: {reason}")
        return None
    lower = tuple(map(float, first - 0.5))
    upper = tuple(map(float, first + values.shape - 0.5))
    return Field(values, (lower, upper), transform, first)


def extent(prim: Usd.Prim, time: Usd.TimeCode) -> Box | None:
    """The box that a prim's ``extent`` says."""
    attribute = prim.GetAttribute("extent")
    corners = attribute.Get(time) if attribute and attribute.HasAuthoredValue() else None
    if corners is None or len(corners) != 2:
        return None
    lower, upper = (tuple(map(float, corner)) for corner in corners)
    return lower, upper
