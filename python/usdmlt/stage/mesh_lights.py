"""MeshLightAPI: meshes that are lights, by emission in their materials.

Every path sees the same surface here: light that the mesh gives off is what a camera sees of it,
whereas UsdLux lets light rays and others differ. With L the light's radiance, the modes
(``light:materialSyncMode``) are

* ``materialGlowTintsLight``: the material's emission times L, and its other responses;
* ``independent``: L in the place of the material's emission, and its other responses;
* ``noMaterialResponse``: L alone.

A mesh without a material has none to tint or respond with: L alone. Light leaves both sides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from pxr import Usd, UsdLux, UsdShade

from usdmlt.errors import Report
from usdmlt.scene import (
    Add,
    Closure,
    Color,
    Layer,
    Material,
    Mesh,
    Mix,
    Multiply,
    PreviewSurface,
    UniformEmission,
)
from usdmlt.stage.light_groups import light_group
from usdmlt.stage.materials import emits
from usdmlt.stage.traversal import Group

BLACK = (0.0, 0.0, 0.0)
Radiance = Callable[[Usd.Prim, float], Color]


class MeshLights:
    """Turns the meshes of prims with LightAPI into emitters; ``materials`` grows by theirs.

    ``radiance(prim, area)``: of the light, as of all others.
    """

    def __init__(
        self, materials: list[Material], material_purpose: str, radiance: Radiance, report: Report
    ):
        self.materials = materials
        self.material_purpose = material_purpose
        self.radiance = radiance
        self.report = report

    def apply(self, group: Group) -> None:
        """Make those of a group's meshes emit whose prims are lights."""
        prims = {str(p.prim.GetPath()): p.prim for p in group.gprims if is_mesh_light(p.prim)}
        if not prims:
            return
        placement = np.array(group.from_world.GetInverse(), dtype=np.float64)
        for mesh in group.scene_meshes:
            if mesh.name in prims:
                self._light(prims[mesh.name], mesh, placement)

    def _light(self, prim: Usd.Prim, mesh: Mesh, placement: np.ndarray) -> None:
        light = self.radiance(prim, world_area(mesh, placement))
        mesh.is_light, mesh.light_group = True, light_group(prim)
        attribute = prim.GetAttribute("light:materialSyncMode")
        mode = str(attribute.Get()) if attribute else "noMaterialResponse"
        if not self._is_bound(prim):
            mode = "noMaterialResponse"
        elif mode == "materialGlowTintsLight" and not self._glows(mesh):
            self.report.warn("mesh lights are dark: their materials do not glow", prim.GetPath())

        def index(old: int) -> int:
            self.materials.append(lit(self.materials[old], light, mode))
            return len(self.materials) - 1

        if isinstance(mesh.materials, np.ndarray):
            used, inverse = np.unique(mesh.materials, return_inverse=True)
            new = np.array([index(int(old)) for old in used], dtype=np.int32)
            mesh.materials = new[inverse].astype(np.int32)
        else:
            mesh.materials = index(mesh.materials)

    def _is_bound(self, prim: Usd.Prim) -> bool:
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        bound = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(
            [prim, *(subset.GetPrim() for subset in subsets)], self.material_purpose
        )
        return any(bound[0])

    def _glows(self, mesh: Mesh) -> bool:
        return any(emits(self.materials[int(i)]) for i in np.unique(mesh.materials))


def is_mesh_light(prim: Usd.Prim) -> bool:
    """Whether a gprim is a light."""
    return prim.HasAPI(UsdLux.LightAPI)


def lit(material: Material, light: Color, mode: str) -> Material:
    """The material of a mesh light in a mode of ``light:materialSyncMode``."""
    glow, response = separated(material.closure)
    emission: Closure = UniformEmission(light)
    if mode == "materialGlowTintsLight":
        emission = Multiply(glow, light) if glow is not None else UniformEmission(BLACK)
    if mode == "noMaterialResponse" or response is None:
        closure = emission
    else:
        closure = Add(response, emission)
    if mode == "noMaterialResponse":
        return Material(closure, name=material.name)
    return replace(material, closure=closure)


def separated(closure: Closure | None) -> tuple[Closure | None, Closure | None]:
    """What of a closure emits, and what responds to light. A top layer does not dim emission."""
    match closure:
        case UniformEmission():
            return closure, None
        case PreviewSurface():
            return UniformEmission(closure.emissiveColor), replace(closure, emissiveColor=BLACK)
        case Multiply():
            glow, response = separated(closure.closure)
            return _with(glow, closure, "closure"), _with(response, closure, "closure")
        case Add():
            (glow_a, response_a), (glow_b, response_b) = separated(closure.a), separated(closure.b)
            return _sum(glow_a, glow_b), _sum(response_a, response_b)
        case Layer():
            glow_top, top = separated(closure.top)
            glow_base, base = separated(closure.base)
            response = Layer(top, base) if top is not None and base is not None else top or base
            return _sum(glow_top, glow_base), response
        case Mix():
            glow_f, foreground = separated(closure.foreground)
            glow_b, background = separated(closure.background)
            return _mixed(closure, glow_f, glow_b), _mixed(closure, foreground, background)
    return None, closure


def _with(part: Closure | None, whole: Multiply, name: str) -> Closure | None:
    return None if part is None else replace(whole, **{name: part})


def _sum(a: Closure | None, b: Closure | None) -> Closure | None:
    return Add(a, b) if a is not None and b is not None else a or b


def _mixed(mix: Mix, foreground: Closure | None, background: Closure | None) -> Closure | None:
    if foreground is None and background is None:
        return None
    nothing = UniformEmission(BLACK)
    return replace(mix, foreground=foreground or nothing, background=background or nothing)


def world_area(mesh: Mesh, placement: np.ndarray) -> float:
    """The area of a mesh in the world. ``placement`` (4, 4): of its group, or of the first instance
    of a prototype."""
    points = mesh.points.astype(np.float64) @ (mesh.transform @ placement)[:3, :3]
    a, b, c = (points[mesh.triangles[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
