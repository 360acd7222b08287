"""The attributes of a prim at one time, with as few questions to USD as can be: large stages have
prims by the hundred thousand, and most of what a schema has nobody authors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from pxr import Usd

# What prims of a type have where nothing is authored, by attribute.
_fallbacks: dict[Usd.PrimTypeInfo, dict[str, Any]] = {}
_name_sets: dict[tuple[str, ...], frozenset[str]] = {}


def authored_names(prim: Usd.Prim) -> frozenset[str]:
    """The names of the properties that any layer has an opinion on; prims that have the same share
    one set."""
    names = tuple(prim.GetAuthoredPropertyNames())
    known = _name_sets.get(names)
    if known is None:
        known = _name_sets[names] = frozenset(names)
    return known


class Attributes:
    """Values of a prim's attributes. ``names``: as of :func:`authored_names`, where known."""

    __slots__ = ("_own_fallbacks", "names", "prim", "time")

    def __init__(self, prim: Usd.Prim, time: Usd.TimeCode, names: frozenset[str] | None = None):
        self.prim = prim
        self.time = time
        self.names = authored_names(prim) if names is None else names
        self._own_fallbacks: dict[str, Any] | None = None

    def __getitem__(self, name: str) -> Any:
        """The value of an attribute, the schema's if nobody authored one; None for none."""
        if name in self.names:
            return self.prim.GetAttribute(name).Get(self.time)
        if self._own_fallbacks is None:
            self._own_fallbacks = _fallbacks.setdefault(self.prim.GetPrimTypeInfo(), {})
        if name not in self._own_fallbacks:
            definition = self.prim.GetPrimDefinition()
            self._own_fallbacks[name] = definition.GetAttributeFallbackValue(name)
        return self._own_fallbacks[name]

    def array(self, name: str, dtype: type) -> np.ndarray:
        """The value of an array attribute; empty for none. It may be USD's own memory, which is not
        written to."""
        value = self[name]
        return np.asarray([] if value is None else value, dtype=dtype)


def of_type(prims: Iterable[Usd.Prim], schema: type) -> Iterator[Usd.Prim]:
    """Those of a schema's type, or of one derived from it; asked once for each name of a type."""
    known: dict[str, bool] = {}
    for prim in prims:
        name = prim.GetTypeName()
        if name not in known:
            known[name] = prim.IsA(schema)
        if known[name]:
            yield prim
