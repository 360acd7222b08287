"""Our own attributes on a RenderSettings prim: ``usdmlt:integrator``, ``usdmlt:samples`` …

They are read by name, so that nothing depends on the applied schema ``UsdmltRenderSettingsAPI``
that ships for authoring tools (usdmlt/schema). Only authored values count: the defaults are those
of :class:`usdmlt.Settings`.
"""

from __future__ import annotations

from typing import Any

from pxr import Usd

from usdmlt.errors import Error, Report, UsageError
from usdmlt.options import LoadOptions
from usdmlt.settings import MUTATIONS, Settings

NAMESPACE = "usdmlt"
WEIGHTS = "mutationWeights"
WORLD_MEDIUM = f"{NAMESPACE}:worldMedium"  # a relationship
# Attributes by the field of usdmlt.Settings, and the type of their values.
FIELDS: dict[str, tuple[str, type]] = {
    "integrator": ("integrator", str),
    "samples": ("samples", int),
    "mutations": ("mutations", int),
    "time": ("time", float),
    "depth": ("depth", int),
    "seed": ("seed", int),
    "filter": ("filter", str),
    "error": ("error", bool),
    "direct": ("direct", str),
    "selective": ("selective", bool),
    "twoStage": ("two_stage", bool),
}
# The same of usdmlt.options.LoadOptions.
LOAD_FIELDS: dict[str, tuple[str, type]] = {"doubleSided": ("double_sided", str)}


def read_usdmlt_settings(
    prim: Usd.Prim, time: Usd.TimeCode, report: Report
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The fields of :class:`usdmlt.Settings` and those of LoadOptions that a prim has authored.

    Raises :class:`Error` with the prim for values out of range; names that are none of ours are
    a warning.
    """
    try:
        found, of_loading = _authored(prim, time, report)
        Settings(**found)
        LoadOptions(**of_loading)
    except UsageError as error:
        raise Error(f"{prim.GetPath()}: {error}") from None
    return found, of_loading


def _authored(
    prim: Usd.Prim, time: Usd.TimeCode, report: Report
) -> tuple[dict[str, Any], dict[str, Any]]:
    found: dict[str, Any] = {}
    of_loading: dict[str, Any] = {}
    weights: dict[str, float] = {}
    for attribute in prim.GetAuthoredPropertiesInNamespace(NAMESPACE):
        name = attribute.GetName().partition(":")[2]
        value = attribute.Get(time) if isinstance(attribute, Usd.Attribute) else None
        if value is None:
            continue
        head, _, mutation = name.partition(":")
        if name in FIELDS:
            field, kind = FIELDS[name]
            found[field] = _typed(name, value, kind)
        elif name in LOAD_FIELDS:
            field, kind = LOAD_FIELDS[name]
            of_loading[field] = _typed(name, value, kind)
        elif head == WEIGHTS and mutation in MUTATIONS:
            weights[mutation] = _typed(name, value, float)
        else:
            report.warn("unknown usdmlt: attributes are ignored", attribute.GetPath())
    if weights:
        found["mutation_weights"] = weights
    return found, of_loading


def _typed(name: str, value: object, kind: type) -> Any:
    """The value as that type; ValueError where it is of another kind."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    fits = {
        str: isinstance(value, str),
        bool: isinstance(value, bool),
        float: is_number,
        int: is_number and float(value).is_integer(),
    }
    if not fits[kind]:
        raise UsageError(f"{NAMESPACE}:{name} is {value!r}, which is no {kind.__name__}")
    return kind(value)
