"""Variant choices and attribute values asked for, as opinions on a layer of their own.

The layer becomes the stage's session layer; a session layer that there was is below it. Nothing
that was opened is changed.
"""

from __future__ import annotations

from collections.abc import Mapping

from pxr import Sdf, Tf, Usd

from usdmlt.errors import Error, UsageError


def session_over(session: Sdf.Layer | None) -> Sdf.Layer:
    """A new layer for edits, with ``session`` as its sublayer and that one's stage metadata."""
    layer = Sdf.Layer.CreateAnonymous("edits.usda")
    if session is not None:
        layer.subLayerPaths.append(session.identifier)
        for key in session.pseudoRoot.ListInfoKeys():
            if key not in ("subLayers", "subLayerOffsets"):
                layer.pseudoRoot.SetInfo(key, session.pseudoRoot.GetInfo(key))
    return layer


def keep_settings(stage: Usd.Stage, opened: Usd.Stage) -> None:
    """Give ``opened`` what is set on an open stage and is in no layer: muted layers, which payloads
    are loaded, and how values are interpolated."""
    opened.MuteAndUnmuteLayers(stage.GetMutedLayers(), [])
    opened.SetLoadRules(stage.GetLoadRules())
    opened.SetInterpolationType(stage.GetInterpolationType())


def choose_variants(stage: Usd.Stage, variants: Mapping[str, str]) -> None:
    """Select variants on the stage's session layer: ``{"/Prim:set": "choice"}``.

    Raises ValueError for other forms and :class:`Error`, with what there is, for prims, sets and
    choices that are not there.
    """
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for target, choice in variants.items():
            path, colon, name = target.partition(":")
            if not colon or not name or not Sdf.Path.IsValidPathString(path):
                raise UsageError(f"variant {target!r} is not /Prim:set=choice")
            sets = _prim(stage, path).GetVariantSets()
            if name not in sets.GetNames():
                raise Error(f"{path}: no variant set {name}; {_there_are(sets.GetNames())}")
            choices = sets.GetVariantSet(name).GetVariantNames()
            if choice not in choices:
                raise Error(f"{path}: no variant {choice} of {name}; {_there_are(choices)}")
            sets.SetSelection(name, choice)


def set_values(stage: Usd.Stage, overrides: Mapping[str, str]) -> None:
    """Set attributes on the stage's session layer: ``{"/Prim.attribute": "value"}``.

    The values are text as in a .usda file, of the attribute's own type, and hold at all times.
    Raises ValueError for text that is no such value and :class:`Error` for attributes that are not
    there.
    """
    for target, text in overrides.items():
        path = Sdf.Path(target) if Sdf.Path.IsValidPathString(target) else Sdf.Path()
        if not path.IsPrimPropertyPath() or not path.IsAbsolutePath():
            raise UsageError(f"{target!r} is not /Prim.attribute")
        prim = _prim(stage, str(path.GetPrimPath()))
        attribute = prim.GetAttribute(path.name)
        if not attribute:
            raise Error(f"{prim.GetPath()}: no attribute {path.name}")
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            attribute.Set(parse_value(text, attribute.GetTypeName(), target))


def parse_value(text: str, type_name: Sdf.ValueTypeName, target: str) -> object:
    """A value of a type from its text; ValueError if it is none."""
    kind = type_name.cppTypeName
    quoted = f'"{text}"' if '"' not in text else text
    forms = {
        "std::string": (text, quoted),
        "TfToken": (text, quoted),
        "SdfAssetPath": (text, f"@{text}@"),
    }.get(kind, (text,))
    for form in forms:
        if "\n" in form:
            continue
        layer = Sdf.Layer.CreateAnonymous(".usda")
        body = f'#usda 1.0\nover "P"\n{{\n{type_name} value = {form}\n}}\n'
        try:
            read = layer.ImportFromString(body)
        except Tf.ErrorException:
            read = False
        spec = layer.GetAttributeAtPath("/P.value") if read else None
        if spec is not None and spec.HasInfo("default") and len(layer.rootPrims) == 1:
            return spec.default
    raise UsageError(f"{target}: {text!r} is no value of type {type_name}")


def _prim(stage: Usd.Stage, path: str) -> Usd.Prim:
    prim = stage.GetPrimAtPath(path) if path.startswith("/") else None
    if not prim:
        raise Error(f"{path}: no such prim")
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        raise Error(f"{path}: is inside an instance, which cannot be edited")
    return prim


def _there_are(names: list[str]) -> str:
    return f"there are {', '.join(sorted(names))}" if names else "there are none"
