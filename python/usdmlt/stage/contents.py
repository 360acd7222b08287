"""What prims a stage has, by type, and what becomes of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from pxr import Usd, UsdGeom, UsdShade

from usdmlt.stage.traversal import classify

UNSUPPORTED = "not rendered"
FATES = {
    "mesh": "geometry",
    "gprim": "geometry",
    "volume": "volume",
    "light": "light",
    "instancer": "instances",
    "skeleton root": "skinned geometry",
    "unsupported": UNSUPPORTED,
}


@dataclass(frozen=True)
class PrimCount:
    """How many active prims of a type there are, prototypes of instances counted once."""

    type: str  # "" is a prim without
    count: int
    fate: str


def count_prims(stage: Usd.Stage) -> list[PrimCount]:
    """The types of a stage, what is rendered first and the most frequent of it first."""
    counts: Counter[str] = Counter()
    fates: dict[str, str] = {}
    for root in (stage.GetPseudoRoot(), *stage.GetPrototypes()):
        for prim in Usd.PrimRange(root):
            if prim == root and not prim.GetTypeName():
                continue
            name = str(prim.GetTypeName())
            counts[name] += 1
            if name not in fates:
                fates[name] = _fate(prim, name)
    order = [*dict.fromkeys(FATES.values()), "material", "camera", "render settings", "grouping"]
    rows = [PrimCount(name, count, fates[name]) for name, count in counts.items()]
    return sorted(rows, key=lambda row: (order.index(row.fate), -row.count, row.type))


def _fate(prim: Usd.Prim, name: str) -> str:
    if prim.IsA(UsdGeom.Camera):
        return "camera"
    if prim.IsA(UsdShade.Material) or prim.IsA(UsdShade.NodeGraph) or prim.IsA(UsdShade.Shader):
        return "material"
    if name.startswith("Render"):
        return "render settings"
    return FATES.get(classify(prim, name).role, "grouping")
