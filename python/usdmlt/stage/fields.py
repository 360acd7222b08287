"""Values of volumes from files: NumPy's .npy and .npz.

A field is any prim with ``filePath`` and ``fieldName``, such as an OpenVDBAsset; what the file is,
its name says. ``fieldIndex`` does not count.
"""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from pxr import Ar, Usd

from usdmlt.errors import Error, Report

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass
class Field:
    """``values`` as they are in the file; ``box``: lower and upper corner in the field's own space,
    None where neither prim nor file say."""

    values: np.ndarray
    box: Box | None


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
    if suffix not in ("npy", "npz"):
        report.warn("fields are read from NumPy's .npy and .npz files only", place)
        return None
    content = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(asset.resolvedPath))
    if not asset.resolvedPath or not content:
        report.warn("files of fields are missing", place)
        return None
    named = prim.GetAttribute("fieldName")
    name = str((named and named.Get(time)) or name)
    try:
        values = _array(bytes(content.GetBuffer()), name)
    except (OSError, ValueError, EOFError, KeyError) as reason:
        raise Error(f"{place}: {reason}") from None
    return Field(values, extent(prim, time))


def _array(data: bytes, name: str) -> np.ndarray:
    """The array of a .npy file, or that of a name in a .npz file."""
    loaded = np.load(io.BytesIO(data), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return loaded
    if name not in loaded.files:
        raise ValueError(f"the file has no array {name!r}, but {', '.join(loaded.files)}")
    values: np.ndarray = loaded[name]
    return values


def extent(prim: Usd.Prim, time: Usd.TimeCode) -> Box | None:
    """The box that a prim's ``extent`` says."""
    attribute = prim.GetAttribute("extent")
    corners = attribute.Get(time) if attribute and attribute.HasAuthoredValue() else None
    if corners is None or len(corners) != 2:
        return None
    lower, upper = (tuple(map(float, corner)) for corner in corners)
    return lower, upper
