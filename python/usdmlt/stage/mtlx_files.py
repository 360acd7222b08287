""".mtlx files that a stage refers to, composed as OpenUSD's own file format plugin would.

usd-core has no MaterialX file format, so such references lead nowhere. Here the files are read with
the MaterialX package (an optional extra) into layers of the plugin's layout, /MaterialX/Materials,
and referenced again, from the same prims, on a session layer over the stage's own. The stage that
was opened is left as it is.

Differences from the plugin: opinions of these references are stronger than those of other
references of the same prim, looks and geometry bindings inside the files are not read, and
instances that contain such references are no longer shared.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator

from pxr import Ar, Sdf, Usd

from usdmlt.errors import Report
from usdmlt.stage.edits import keep_settings, session_over
from usdmlt.stage.mtlx_layers import UnreadableDocument, read_layer

MISSING = "MaterialX files need the MaterialX package (pip install 'usdmlt[materialx]')"


def with_mtlx_files(stage: Usd.Stage, report: Report) -> Usd.Stage:
    """The stage, or another one on the same root layer in which its .mtlx references compose."""
    if not _refers_to_mtlx(stage):
        return stage
    arcs = list(_arcs(stage))
    if arcs and importlib.util.find_spec("MaterialX") is None:
        for prim, _, reference in arcs:
            report.warn(MISSING, f"{prim.GetPath()} ({reference.assetPath})")
        return stage
    layers: dict[str, Sdf.Layer | None] = {}
    edits = Sdf.Layer.CreateAnonymous("mtlx.usda")
    for prim, layer, reference in arcs:
        path = _resolve(stage, layer, reference.assetPath)
        if path not in layers:
            try:
                layers[path] = read_layer(path or reference.assetPath)
            except UnreadableDocument as reason:
                layers[path] = None
                report.warn("MaterialX files cannot be read", f"{prim.GetPath()} ({reason})")
        document = layers[path]
        if document is not None:
            _refer(edits, prim, document, reference)
    if not any(layers.values()):
        return stage
    session = session_over(stage.GetSessionLayer())
    session.subLayerPaths.insert(0, edits.identifier)
    opened = Usd.Stage.OpenMasked(
        stage.GetRootLayer(),
        session,
        stage.GetPathResolverContext(),
        stage.GetPopulationMask(),
        Usd.Stage.LoadAll,
    )
    keep_settings(stage, opened)
    return opened


def _is_mtlx(path: str) -> bool:
    return path.lower().endswith(".mtlx")


def _refers_to_mtlx(stage: Usd.Stage) -> bool:
    """Whether any layer of the stage does, which is told without looking at its prims."""
    return any(
        _is_mtlx(asset)
        for layer in stage.GetUsedLayers()
        for asset in layer.GetCompositionAssetDependencies()
    )


def _arcs(stage: Usd.Stage) -> Iterator[tuple[Usd.Prim, Sdf.Layer, Sdf.Reference | Sdf.Payload]]:
    """Every reference and payload to a .mtlx file: the prim it is on, and the layer that says so.

    The weakest first, so that the strongest is referenced first in the end.
    """
    predicate = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    for prim in Usd.PrimRange.Stage(stage, predicate):
        if not (prim.HasAuthoredReferences() or prim.HasAuthoredPayloads()):
            continue
        for spec in reversed(prim.GetPrimStack()):
            for arcs in (spec.payloadList, spec.referenceList):
                for arc in reversed(arcs.GetAddedOrExplicitItems()):
                    if _is_mtlx(arc.assetPath):
                        yield prim, spec.layer, arc


def _resolve(stage: Usd.Stage, layer: Sdf.Layer, asset: str) -> str:
    """The file of an asset path that a layer holds; "" if there is none."""
    with Ar.ResolverContextBinder(stage.GetPathResolverContext()):
        return str(Ar.GetResolver().Resolve(layer.ComputeAbsolutePath(asset)))


def _refer(
    edits: Sdf.Layer, prim: Usd.Prim, document: Sdf.Layer, arc: Sdf.Reference | Sdf.Payload
) -> None:
    """Reference a document from the prim; shared instances above it are made single."""
    above = prim
    while prim.IsInstanceProxy() and above and not above.IsPseudoRoot():
        if above.IsInstance():
            Sdf.CreatePrimInLayer(edits, above.GetPath()).SetInfo("instanceable", False)
        above = above.GetParent()
    spec = Sdf.CreatePrimInLayer(edits, prim.GetPath())
    spec.referenceList.Prepend(Sdf.Reference(document.identifier, arc.primPath, arc.layerOffset))
