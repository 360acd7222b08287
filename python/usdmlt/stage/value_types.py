"""Attributes whose values are of another type than their schema says, which USD lets pass."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from pxr import Sdf, Usd

from usdmlt.errors import Error, UsageError

# What no schema of USD declares, or only by another name.
UNDECLARED = {
    "primvars:normals": Sdf.ValueTypeNames.Normal3fArray,
    "primvars:widths": Sdf.ValueTypeNames.FloatArray,
}


@contextmanager
def mistyped_values_named(stage: Usd.Stage, time: Usd.TimeCode) -> Iterator[None]:
    """Where reading stumbles over a value, an :class:`Error` that names the attribute, if one of
    the stage is of a wrong type. Looking at all of them before would slow down every stage."""
    try:
        yield
    except (Error, UsageError):
        raise
    except Exception as stumble:
        wrong = first_mistyped(stage, time)
        if wrong is None:
            raise
        raise Error(wrong) from stumble


def first_mistyped(stage: Usd.Stage, time: Usd.TimeCode) -> str | None:
    """The first attribute, inside of instances too, whose value is not of its type."""
    for prim in stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)):
        for attribute in prim.GetAuthoredAttributes():
            expected = _expected(attribute)
            value = attribute.Get(time) if expected else None
            if value is None:
                continue
            found = Sdf.GetValueTypeNameForValue(value)
            if _form(found) != _form(expected):
                return f"{attribute.GetPath()} is of type {found}, not {expected}"
    return None


def _expected(attribute: Usd.Attribute) -> Sdf.ValueTypeName | None:
    """The type that the schemas of its prim give an attribute, or the ``inputs:`` of its name."""
    definition, name = attribute.GetPrim().GetPrimDefinition(), attribute.GetName()
    for known in (name, f"inputs:{name}"):
        declared = definition.GetAttributeDefinition(known)
        if declared:
            return declared.GetTypeName()
    return UNDECLARED.get(name)


def _form(typed: Sdf.ValueTypeName) -> tuple[object, ...]:
    """Equal for types whose values can be read as each other's: numbers of any precision, vectors
    of any role, strings and tokens."""
    element = typed.scalarType.defaultValue
    array = np.asarray(element)
    kind = {"O": type(element), "U": str}.get(array.dtype.kind, float)
    return typed.isArray, kind, array.shape
