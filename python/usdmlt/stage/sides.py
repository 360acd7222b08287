"""``doubleSided``: gprims that are seen from their front alone, where that is asked for.

Where a surface refracts it keeps its back: glass without the far side would not be glass. So do
curves, whose sides are ours and not the author's.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.scene import (
    Closure,
    Dielectric,
    GeneralizedSchlick,
    Material,
    Mesh,
    PreviewSurface,
)
from usdmlt.stage.traversal import Group


def apply_sides(group: Group, materials: list[Material]) -> None:
    """Make those of a group's meshes one-sided whose prims are not ``doubleSided``."""
    prims = {str(placed.prim.GetPath()): placed.prim for placed in group.gprims}
    for mesh in group.scene_meshes:
        mesh.double_sided = _is_double_sided(prims[mesh.name]) or refracts(mesh, materials)


def _is_double_sided(prim: Usd.Prim) -> bool:
    gprim = UsdGeom.Gprim(prim)
    return not gprim or prim.IsA(UsdGeom.Curves) or bool(gprim.GetDoubleSidedAttr().Get())


def refracts(mesh: Mesh, materials: list[Material]) -> bool:
    """Whether any of a mesh's materials lets light through an interface."""
    used = (materials[index] for index in np.unique(mesh.materials).tolist())
    return any(not m.thin_walled and _closure_refracts(m.closure) for m in used)


def _closure_refracts(closure: Closure | None) -> bool:
    match closure:
        case Dielectric() | GeneralizedSchlick():
            return "T" in closure.scatter_mode
        case PreviewSurface():
            return closure.opacity != 1.0
    if not is_dataclass(closure):
        return False
    return any(_closure_refracts(getattr(closure, f.name)) for f in fields(closure))
