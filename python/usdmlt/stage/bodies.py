"""Closed meshes as bodies of media: which one each is filled with, and what of them has no surface.

As soon as anything in a stage scatters, absorbs or glows between surfaces, closed meshes that
refract and hold nothing else are filled with a clear medium: there is no fog inside of glass.
"""

from __future__ import annotations

import numpy as np
from pxr import Usd

from usdmlt.errors import Error, Report
from usdmlt.media import is_closed
from usdmlt.scene import Medium, Mesh
from usdmlt.stage.materials import Materials
from usdmlt.stage.motion import settled
from usdmlt.stage.sides import refracts
from usdmlt.stage.traversal import Group

PRIORITY = "usdmlt:mediumPriority"
CLEAR = "clear"


def fill(group: Group, materials: Materials, report: Report) -> None:
    """Give each mesh of a group the medium of its material, and set those without a surface apart.

    A mesh of several materials has the medium of the most triangles. One that is not closed has
    none: a warning names it.
    """
    if not materials.interiors:
        return
    surfaces = []
    for mesh in group.scene_meshes:
        index = _medium(mesh, materials)
        if index is not None and not is_closed(settled(mesh)):
            report.warn("meshes that are not closed hold no medium", mesh.name)
            index = None
        mesh.medium = index
        if not set(np.unique(mesh.materials).tolist()) <= materials.without_surface:
            surfaces.append(mesh)
        elif index is not None:
            group.scene_volumes.append(mesh)
    group.scene_meshes = surfaces


def fill_glass(groups: list[Group], materials: Materials) -> None:
    """Fill what refracts, and holds nothing else, with a clear medium, where anything else is not
    clear."""
    clear: int | None = None
    if not any(map(interacts, materials.media)):
        return
    for group in groups:
        for mesh in group.scene_meshes:
            if mesh.medium is not None or not refracts(mesh, materials.materials):
                continue
            if is_closed(settled(mesh)):
                clear = materials.add_medium(Medium(name=CLEAR)) if clear is None else clear
                mesh.medium = clear


def set_priorities(groups: list[Group]) -> None:
    """Which of overlapping bodies count, as their prims say."""
    for group in groups:
        bodies = [m for m in (*group.scene_meshes, *group.scene_volumes) if m.medium is not None]
        prims = {str(p.prim.GetPath()): p.prim for p in group.gprims} if bodies else {}
        for mesh in bodies:
            if mesh.name in prims:
                mesh.medium_priority = priority(prims[mesh.name])


def priority(prim: Usd.Prim) -> int:
    """Which of overlapping bodies counts: the highest."""
    attribute = prim.GetAttribute(PRIORITY)
    value = attribute.Get() if attribute and attribute.HasAuthoredValue() else 0
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**31:
        raise Error(f"{prim.GetPath()}: {PRIORITY} is {value!r}, not a whole number")
    return value


def interacts(medium: Medium) -> bool:
    """Whether light that passes a medium is changed, or added to, by it."""
    return any(map(any, (medium.scattering, medium.absorption, medium.emission))) or glows(medium)


def glows(medium: Medium) -> bool:
    """Whether a medium gives off light."""
    grid = medium.grid
    return any(medium.emission) or (grid is not None and grid.emission is not None)


def _medium(mesh: Mesh, materials: Materials) -> int | None:
    """Of the materials of a mesh, the medium of the most triangles."""
    used, counts = np.unique(mesh.materials, return_counts=True)
    triangles: dict[int, int] = {}
    for material, count in zip(used.tolist(), counts.tolist(), strict=True):
        medium = materials.interiors.get(material)
        if medium is not None:
            triangles[medium] = triangles.get(medium, 0) + count
    return max(triangles, key=lambda medium: triangles[medium], default=None)
