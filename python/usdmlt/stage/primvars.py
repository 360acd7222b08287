"""Primvars of any interpolation, indexed or not, as values at the corners of triangles."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property
from typing import Protocol

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Primvar
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.color import ColorSpaces

COLOR_ROLE = "Color"


class Topology:
    """How the triangles of a mesh relate to what was authored.

    ``vertices`` (m, 3): the points of each triangle; ``corners`` (m, 3): its face corners, in the
    winding of the scene description; ``faces`` (m,): its authored face. None: all faces are
    triangles and all of them are there.
    """

    def __init__(
        self,
        point_count: int,
        face_count: int,
        corner_count: int,
        vertices: np.ndarray,
        corners: np.ndarray | None = None,
        faces: np.ndarray | None = None,
    ):
        self.point_count, self.face_count = point_count, face_count
        self.corner_count = corner_count
        self.vertices = vertices
        if corners is not None:
            self.corners = corners
        if faces is not None:
            self.faces = faces

    @cached_property
    def corners(self) -> np.ndarray:
        return np.arange(self.vertices.size, dtype=np.int32).reshape(-1, 3)

    @cached_property
    def faces(self) -> np.ndarray:
        return np.arange(len(self.vertices), dtype=np.int32)

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
    than four each. It may be USD's own memory, which is not written to."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        return None
    if not hasattr(value, "FromNumpy"):  # a single value
        array = array[None]
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or array.shape[1] > 4:
        return None
    return np.ascontiguousarray(array, dtype=np.float32)


# A primvar and its values; None for values that are no numbers.
Found = tuple[UsdGeom.Primvar, "np.ndarray | None"]


class Primvars:
    """Reads the primvars of gprims; what they inherit, once for all of them."""

    def __init__(self, time: Usd.TimeCode, colors: ColorSpaces, report: Report):
        self.time = time
        self.colors = colors
        self.report = report
        self._inherited: dict[tuple[Usd.Prim, str], Found | None] = {}

    def read(self, prim: Attributes, names: Iterable[str], topology: Spreads) -> dict[str, Primvar]:
        """The named primvars of a gprim, its own or inherited constant ones."""
        found = {}
        for name in names:
            own = self.own(prim, name)
            if own is not None:
                read = self._spread(
                    own,
                    read_values(own, self.time, self.colors, self.report),
                    f"primvars:{name}:indices" in prim.names,
                    topology,
                )
            else:
                inherited = self.inherited(prim.prim.GetParent(), name)
                read = inherited and self._spread(*inherited, True, topology)
            if read is not None:
                found[name] = read
        return found

    def own(self, prim: Attributes, name: str) -> UsdGeom.Primvar | None:
        """The primvar that a prim itself has."""
        if f"primvars:{name}" not in prim.names:
            return None
        primvar = UsdGeom.Primvar(prim.prim.GetAttribute(f"primvars:{name}"))
        return primvar if primvar and primvar.HasAuthoredValue() else None

    def inherited(self, parent: Usd.Prim, name: str) -> Found | None:
        """The primvar that children of a prim inherit, and its values."""
        if (parent, name) not in self._inherited:
            self._inherited[parent, name] = self._find_inherited(parent, name)
        return self._inherited[parent, name]

    def _find_inherited(self, parent: Usd.Prim, name: str) -> Found | None:
        if not parent or parent.IsPseudoRoot():
            return None
        primvar = UsdGeom.PrimvarsAPI(parent).FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasAuthoredValue():
            return None
        if primvar.GetInterpolation() != UsdGeom.Tokens.constant:
            return None
        return primvar, read_values(primvar, self.time, self.colors, self.report)

    def _spread(
        self,
        primvar: UsdGeom.Primvar,
        values: np.ndarray | None,
        may_be_indexed: bool,
        topology: Spreads,
    ) -> Primvar | None:
        """A primvar on a mesh; None, with a warning, if it does not fit."""
        if values is None:
            return None
        indices = None
        if may_be_indexed and primvar.IsIndexed():
            indices = np.asarray(primvar.GetIndices(self.time))
        interpolation = primvar.GetInterpolation()
        path = primvar.GetAttr().GetPath
        try:
            result = topology.spread(values, indices, interpolation)
        except IndexError:
            raise Error(
                f"{path()}: primvar indices out of range (0 to {len(values) - 1})"
            ) from None
        if result is None:
            count = len(values) if indices is None else len(indices)
            self.report.warn(
                "primvars whose number of values does not fit their interpolation are ignored",
                f"{path()} ({count} {interpolation})",
            )
        else:
            result.is_color = primvar.GetAttr().GetTypeName().role == COLOR_ROLE
        return result


def read_values(
    primvar: UsdGeom.Primvar, time: Usd.TimeCode, colors: ColorSpaces, report: Report
) -> np.ndarray | None:
    """(count, width) float32 values of a primvar as authored, colours in the rendering space; None,
    with a warning, for what is no numbers."""
    attribute = primvar.GetAttr()
    value = primvar.Get(time)
    values = None if value is None else as_floats(value)
    if values is None or (
        attribute.HasAuthoredMetadata("elementSize") and primvar.GetElementSize() != 1
    ):
        report.warn("primvars of this type are not read", attribute.GetPath())
        return None
    if not math.isfinite(values.sum(dtype=np.float64)):
        report.warn("values of primvars that are not finite are read as 0", attribute.GetPath())
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    if values.shape[1] >= 3 and attribute.GetTypeName().role == COLOR_ROLE:
        rgb = values[:, :3]
        converted = colors.convert(rgb, colors.space_of(attribute))
        if converted is not rgb:
            values = np.concatenate([converted, values[:, 3:]], axis=1, dtype=np.float32)
    return values
