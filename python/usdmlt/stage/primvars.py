"""Primvars of any interpolation, indexed or not, as values at the corners of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Primvar
from usdmlt.stage.color import ColorSpaces

COLOR_ROLE = "Color"


@dataclass
class Topology:
    """How the triangles of a mesh relate to what was authored.

    ``corners`` (m, 3): face corners of each triangle, in the winding of the scene description;
    ``faces`` (m,): the authored face of each triangle; ``vertices`` (m, 3): its points.
    """

    point_count: int
    face_count: int
    corner_count: int
    corners: np.ndarray
    faces: np.ndarray
    vertices: np.ndarray

    def elements(self, interpolation: str) -> tuple[int, np.ndarray]:
        """How many values an interpolation takes, and which of them each triangle corner has."""
        shape = self.vertices.shape
        if interpolation == UsdGeom.Tokens.constant:
            return 1, np.zeros(shape, dtype=np.int32)
        if interpolation == UsdGeom.Tokens.uniform:
            return self.face_count, np.repeat(self.faces[:, None], 3, axis=1)
        if interpolation == UsdGeom.Tokens.faceVarying:
            return self.corner_count, self.corners
        return self.point_count, self.vertices

    def spread(
        self, values: np.ndarray, indices: np.ndarray | None, interpolation: str
    ) -> Primvar | None:
        """Authored values (count, width) at the corners of triangles; None if their number does not
        fit. ``indices`` are within range."""
        expected, elements = self.elements(interpolation)
        if not fits(values, indices, expected, interpolation):
            return None
        if indices is not None:
            return Primvar(values, indices.astype(np.int32, copy=False)[elements])
        return Primvar(values, None if elements is self.vertices else elements)

    def subset(self, keep: np.ndarray) -> Topology:
        """The same mesh with fewer triangles, chosen by a mask."""
        return Topology(
            self.point_count,
            self.face_count,
            self.corner_count,
            self.corners[keep],
            self.faces[keep],
            self.vertices[keep],
        )


def fits(values: np.ndarray, indices: np.ndarray | None, expected: int, interpolation: str) -> bool:
    """Whether there are as many values as an interpolation takes; more than one constant is fine.

    Raises IndexError for indices out of range.
    """
    count = len(values) if indices is None else len(indices)
    if count < expected or (count > expected and interpolation != UsdGeom.Tokens.constant):
        return False
    if indices is None or not len(indices):
        return True
    if not (indices.min() >= 0 and indices.max() < len(values)):
        raise IndexError
    return True


class Spreads(Protocol):
    """What authored values are spread over: the triangles of a mesh, and how they came about.

    ``faces`` (triangles,): the authored face of each; ``vertices`` (triangles, 3): its points.
    """

    point_count: int
    face_count: int
    faces: np.ndarray
    vertices: np.ndarray

    def spread(
        self, values: np.ndarray, indices: np.ndarray | None, interpolation: str
    ) -> Primvar | None: ...


def as_floats(value) -> np.ndarray | None:
    """(count, width) float32 of a Vt array or a single value; None for what is no numbers, or more
    than four each."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        return None
    if not hasattr(value, "FromNumpy"):  # a single value
        array = array[None]
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or array.shape[1] > 4:
        return None
    return np.array(array, dtype=np.float32, order="C")  # a copy: USD owns the original


def read_primvars(
    prim: Usd.Prim,
    names: set[str],
    topology: Spreads,
    time: Usd.TimeCode,
    colors: ColorSpaces,
    report: Report,
) -> dict[str, Primvar]:
    """The named primvars of a gprim, its own or inherited constant ones."""
    found = {}
    api = UsdGeom.PrimvarsAPI(prim)
    for name in sorted(names):
        primvar = api.FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasAuthoredValue():
            continue
        read = read_primvar(primvar, topology, time, colors, report)
        if read is not None:
            found[name] = read
    return found


def read_values(
    primvar: UsdGeom.Primvar, time: Usd.TimeCode, colors: ColorSpaces, report: Report
) -> np.ndarray | None:
    """(count, width) float32 values of a primvar as authored, colours in the rendering space; None,
    with a warning, for what is no numbers."""
    path = primvar.GetAttr().GetPath()
    value = primvar.Get(time)
    values = None if value is None else as_floats(value)
    if values is None or primvar.GetElementSize() != 1:
        report.warn("primvars of this type are not read", path)
        return None
    if not np.isfinite(values).all():
        report.warn("values of primvars that are not finite are read as 0", path)
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    if values.shape[1] >= 3 and primvar.GetTypeName().role == COLOR_ROLE:
        space = colors.space_of(primvar.GetAttr())
        rgb = colors.convert(values[:, :3], space)
        values = np.concatenate([rgb, values[:, 3:]], axis=1).astype(np.float32, copy=False)
    return values


def read_primvar(
    primvar: UsdGeom.Primvar,
    topology: Spreads,
    time: Usd.TimeCode,
    colors: ColorSpaces,
    report: Report,
) -> Primvar | None:
    """One primvar; None, with a warning, if it does not fit the mesh."""
    path = primvar.GetAttr().GetPath()
    values = read_values(primvar, time, colors, report)
    if values is None:
        return None
    indices = None
    if primvar.IsIndexed():
        indices = np.asarray(primvar.GetIndices(time))
    try:
        result = topology.spread(values, indices, primvar.GetInterpolation())
    except IndexError:
        raise Error(f"{path}: primvar indices out of range (0 to {len(values) - 1})") from None
    if result is None:
        count = len(values) if indices is None else len(indices)
        report.warn(
            "primvars whose number of values does not fit their interpolation are ignored",
            f"{path} ({count} {primvar.GetInterpolation()})",
        )
    return result
