"""UsdRender vars: the layers that a product asks for.

A var is called by ``driver:parameters:aov:name``, else by its prim; those that every picture can
have keep their own names unless they are called otherwise. ``dataType`` says whether a file has it
in half floats; without it, what suits the layer.
"""

from __future__ import annotations

from dataclasses import replace

from pxr import Usd, UsdRender

from usdmlt import layers
from usdmlt.errors import Report, UsageError
from usdmlt.layers import Layer

CALLED = "driver:parameters:aov:name"
LPE_PREFIX = "lpe:"  # of raw source names, as RenderMan has them


def read_render_vars(
    product: UsdRender.Product, time: Usd.TimeCode, report: Report
) -> tuple[Layer, ...]:
    """The layers of a product's ordered vars, but for those that every picture has. What cannot be
    made is left out with a warning."""
    stage = product.GetPrim().GetStage()
    found: dict[str, Layer] = {}
    for target in product.GetOrderedVarsRel().GetForwardedTargets():
        prim = stage.GetPrimAtPath(target)
        if not prim or not prim.IsA(UsdRender.Var):
            report.warn("render vars of the product do not exist", target)
            continue
        try:
            layer = _read(UsdRender.Var(prim), time)
        except UsageError as error:
            report.warn("render vars that cannot be made are left out", f"{target} ({error})")
            continue
        if layer.shows in layers.ALWAYS:
            continue
        if layer.stem in found:
            report.warn("of several render vars of one name the first counts", target)
            continue
        found[layer.stem] = layer
    return tuple(found.values())


def _read(var: UsdRender.Var, time: Usd.TimeCode) -> Layer:
    prim = var.GetPrim()
    source = str(var.GetSourceNameAttr().Get(time) or "")
    kind = str(var.GetSourceTypeAttr().Get(time) or "raw")
    called = prim.GetAttribute(CALLED)
    name = str(called.Get(time) or "") if called else ""
    if kind == "primvar":
        layer = layers.primvar(source.removeprefix(layers.PRIMVAR_PREFIX))
        name = name or prim.GetName()
    elif kind == "lpe" or source.startswith(LPE_PREFIX):
        expression = source.removeprefix(LPE_PREFIX)
        known = layers.KNOWN.get(layers.ALIASES.get(expression, ""))
        layer = known or layers.light_paths(prim.GetName(), expression)
    else:
        layer = _known(source, prim.GetName())
    data_type = var.GetDataTypeAttr()
    if data_type.HasAuthoredValue() and layer.kind != "id":
        asked = str(data_type.Get(time))
        layer = replace(layer, half=asked.startswith("half") or asked.endswith("h"))
    return replace(layer, name=name or layer.name)


def _known(source: str, prim_name: str) -> Layer:
    """By the source, else by the prim's name."""
    for name in (source, prim_name):
        layer = layers.KNOWN.get(layers.ALIASES.get(name, name))
        if layer is not None:
            return layer
    if source.startswith((layers.PRIMVAR_PREFIX, layers.LIGHT_GROUP_PREFIX)):
        return layers.parse(source)
    raise UsageError(f"there is no layer {source or prim_name}")
