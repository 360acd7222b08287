"""Gprims into meshes: geometry, then materials, then the primvars the materials read."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from usdmlt.errors import Error, Report
from usdmlt.scene import Mesh
from usdmlt.stage import tessellated
from usdmlt.stage.color import ColorSpaces
from usdmlt.stage.deformation import Deformation
from usdmlt.stage.detail import Detail, SteadyDetail
from usdmlt.stage.displacement import displaced
from usdmlt.stage.draw_modes import STAND_IN, StandIns
from usdmlt.stage.gprims import read_gprim
from usdmlt.stage.materials import Materials, bound_materials
from usdmlt.stage.meshes import face_materials, read_mesh
from usdmlt.stage.motion import Shutter, carried
from usdmlt.stage.primvars import Spreads, as_floats, read_primvars
from usdmlt.stage.skinning import Skin, Skinning
from usdmlt.stage.transforms import singular
from usdmlt.stage.traversal import Group, Placed


class GeometryReader:
    """Reads the gprims of groups."""

    def __init__(
        self,
        time: Usd.TimeCode,
        colors: ColorSpaces,
        materials: Materials,
        material_purpose: str,
        skinning: Skinning,
        stand_ins: StandIns,
        detail: Detail,
        shutter: Shutter,
        report: Report,
    ):
        self.time = time
        self.colors = colors
        self.materials = materials
        self.material_purpose = material_purpose
        self.skinning = skinning
        self.stand_ins = stand_ins
        self.detail = detail
        self.report = report
        self.deformation = Deformation(shutter, skinning, report)
        self._xforms = UsdGeom.XformCache(time)

    def read(self, group: Group) -> list[Mesh]:
        """The meshes of a group, placed in its space."""
        prims = [placed.prim for placed in group.gprims]
        bound = bound_materials(prims, self.material_purpose, self.report)
        meshes = []
        for placed, material in zip(group.gprims, bound, strict=True):
            mesh = self._read_one(group, placed, material)
            if mesh is not None:
                meshes.append(mesh)
        return meshes

    def _read_one(
        self, group: Group, placed: Placed, material: UsdShade.Material | None
    ) -> Mesh | None:
        prim, skin = placed.prim, None
        detail = self.detail.placed(placed.matrix, group.placements.transforms)
        if self.deformation.shutter.opens:
            detail = SteadyDetail(**vars(detail))
        if placed.kind == STAND_IN:
            return self._stand_in(placed, detail)
        if placed.kind in tessellated.READERS:
            read = tessellated.READERS[placed.kind](prim, self.time, detail, self.report)
        elif placed.kind == "Mesh" or prim.IsA(UsdGeom.Mesh):
            read, skin = self._read_polygons(prim, detail)
        else:
            read = read_gprim(prim, placed.kind, self.time, self.report)
        if read is None:
            return None
        mesh, topology = read
        mesh.transform = placed.matrix
        if skin is not None:
            to_world = self._xforms.GetLocalToWorldTransform(skin.skeleton)
            mesh.transform = np.array(to_world * group.from_world, dtype=np.float64)
        if singular(mesh.transform):
            raise Error(f"{prim.GetPath()}: the transform is singular")
        self._assign_materials(prim, mesh, topology, material)
        textures = self.materials.networks.textures.textures

        def displace(shape: Mesh) -> Mesh:
            return displaced(shape, self.materials.materials, textures, self.report)

        if not self.deformation.shutter.opens:
            return displace(mesh)
        return self.deformation.moving(group, placed, mesh, topology, skin, detail, displace)

    def _stand_in(self, placed: Placed, detail: Detail) -> Mesh | None:
        mesh = self.stand_ins.read(placed.prim, detail)
        if mesh is not None:
            mesh.transform = placed.matrix
            if singular(mesh.transform):
                raise Error(f"{placed.prim.GetPath()}: the transform is singular")
            if placed.motion is not None:
                mesh = carried(mesh, placed.motion)
        return mesh

    def _read_polygons(
        self, prim: Usd.Prim, detail: Detail
    ) -> tuple[tuple[Mesh, Spreads] | None, Skin | None]:
        value = UsdGeom.Mesh(prim).GetPointsAttr().Get(self.time)
        points = as_floats(value) if np.ndim(value) == 2 else None
        if points is None or points.shape[1] != 3:
            self.report.note("meshes without points", prim.GetPath())
            return None, None
        points, skin = self.skinning.skin(prim, points)
        read = read_mesh(prim, points, self.time, detail, self.report)
        if read is not None and skin is not None and read[0].normals is not None:
            self._skin_normals(prim, *read, skin)
        return read, skin

    def _skin_normals(self, prim: Usd.Prim, mesh: Mesh, topology: Spreads, skin: Skin) -> None:
        """Authored normals follow the joints; subdivision surfaces are made of skinned points."""
        scheme = UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get(self.time)
        if scheme != UsdGeom.Tokens.none:
            return
        mesh.normals = skin.primvar(mesh.normals, topology)

    def _assign_materials(
        self,
        prim: Usd.Prim,
        mesh: Mesh,
        topology: Spreads,
        material: UsdShade.Material | None,
    ) -> None:
        default = self._material(prim, material)
        subsets = []
        if prim.GetChildrenNames():
            subsets = self._subsets(prim, default)
        mesh.materials = face_materials(topology, default, subsets)
        used = np.unique(mesh.materials).tolist()
        names = set().union(*(self.materials.primvars(index) for index in used))
        primvars = read_primvars(prim, names, topology, self.time, self.colors, self.report)
        mesh.primvars = {
            name: primvars.get(name, mesh.primvars.get(name))
            for name in sorted(names)
            if name in primvars or name in mesh.primvars
        }

    def _material(self, prim: Usd.Prim, material: UsdShade.Material | None) -> int:
        index = None if material is None else self.materials.index(material)
        if index is None:
            opacity = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayOpacity")
            values = opacity.Get(self.time) if opacity else None
            index = self.materials.fallback(values is not None and bool(np.any(np.less(values, 1))))
        return index

    def _subsets(self, prim: Usd.Prim, default: int) -> list[tuple[Usd.Prim, np.ndarray, int]]:
        """The face subsets that bind materials: prim, faces and material."""
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        prims = [subset.GetPrim() for subset in subsets]
        found = []
        bound = bound_materials(prims, self.material_purpose, self.report)
        for subset, material in zip(subsets, bound, strict=True):
            if subset.GetElementTypeAttr().Get() != UsdGeom.Tokens.face:
                self.report.warn("subsets of other than faces are ignored", subset.GetPath())
                continue
            faces = np.asarray(subset.GetIndicesAttr().Get(self.time) or [], dtype=np.int64)
            index = default if material is None else self._material(prim, material)
            found.append((subset.GetPrim(), faces, index))
        return found
