"""Gprims into meshes: geometry, then materials, then the primvars the materials read."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from usdmlt.errors import Error, Report
from usdmlt.scene import Mesh
from usdmlt.stage import gprims, tessellated
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.color import ColorSpaces
from usdmlt.stage.deformation import Deformation
from usdmlt.stage.detail import Detail, SteadyDetail
from usdmlt.stage.displacement import displaced
from usdmlt.stage.draw_modes import STAND_IN, StandIns
from usdmlt.stage.light_groups import GEOMETRY_ATTRIBUTES, light_group
from usdmlt.stage.materials import Materials, bound_materials
from usdmlt.stage.meshes import face_materials, read_mesh
from usdmlt.stage.motion import Shutter, carried
from usdmlt.stage.primvars import Primvars, Spreads, as_floats
from usdmlt.stage.reading_progress import Tally
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
        primvars_kept: frozenset[str] = frozenset(),
    ):
        self.time = time
        self.primvars_kept = primvars_kept
        self.materials = materials
        self.material_purpose = material_purpose
        self.skinning = skinning
        self.stand_ins = stand_ins
        self.detail = detail
        self.report = report
        self.primvars = Primvars(time, colors, report)
        self.shutter = shutter
        self._deformations: dict[float, Deformation] = {}
        self._xforms = UsdGeom.XformCache(time)

    def read(self, group: Group, tally: Tally) -> list[Mesh]:
        """The meshes of a group, placed in its space."""
        if not group.gprims:
            return []
        prims = [placed.prim for placed in group.gprims]
        bound = bound_materials(prims, self.material_purpose, self.report)
        transforms = np.array([np.array(placed.transform) for placed in group.gprims])
        flat = singular(transforms)
        meshes = []
        for i, placed in enumerate(group.gprims):
            mesh = self._read_one(group, placed, transforms[i], flat[i], bound[i])
            if mesh is not None:
                meshes.append(mesh)
            tally.count()
        return meshes

    def _read_one(
        self,
        group: Group,
        placed: Placed,
        transform: np.ndarray,
        is_singular: bool,
        material: UsdShade.Material | None,
    ) -> Mesh | None:
        """``transform`` (4, 4): of the prim in its group."""
        prim, skin = placed.prim, None
        if not np.isfinite(transform).all():
            raise Error(f"{prim.GetPath()}: the transform is not finite")
        attributes = Attributes(prim, self.time, placed.names)
        detail = self.detail.placed(transform, group.placements.transforms)
        shutter = self.shutter.scaled(placed.blur)
        if shutter.opens:
            detail = SteadyDetail(**vars(detail))
        if placed.kind == STAND_IN:
            read = self.stand_ins.read(prim, detail)
        elif placed.kind in tessellated.READERS:
            read = tessellated.READERS[placed.kind](prim, self.time, detail, self.report)
        elif placed.kind in gprims.READERS or placed.kind == gprims.POINT_SPHERE:
            read = gprims.read_gprim(attributes, placed.kind, self.report)
        else:
            read, skin = self._read_polygons(attributes, detail)
        if read is None:
            return None
        if skin is not None:
            to_world = self._xforms.GetLocalToWorldTransform(skin.skeleton)
            transform = np.array(to_world * group.from_world, dtype=np.float64)
            is_singular = singular(transform)
        if is_singular:
            raise Error(f"{prim.GetPath()}: the transform is singular")
        if placed.kind == STAND_IN:
            read.transform = transform
            return read if placed.motion is None else carried(read, placed.motion)
        mesh, topology = read
        mesh.transform = transform
        self._assign_materials(attributes, mesh, topology, material)
        textures = self.materials.networks.textures.textures

        def displace(shape: Mesh) -> Mesh:
            return displaced(shape, self.materials.materials, textures, self.report)

        if not shutter.opens:
            return displace(mesh)
        if placed.blur not in self._deformations:
            self._deformations[placed.blur] = Deformation(shutter, self.skinning, self.report)
        deformation = self._deformations[placed.blur]
        return deformation.moving(group, placed, mesh, topology, skin, detail, displace)

    def _read_polygons(
        self, prim: Attributes, detail: Detail
    ) -> tuple[tuple[Mesh, Spreads] | None, Skin | None]:
        value = prim["points"]
        # A single point has a type that `points` cannot have.
        points = as_floats(value) if np.ndim(value) == 2 else None
        if points is None or points.shape[1] != 3:
            self.report.note("meshes without points", prim.prim.GetPath())
            return None, None
        points, skin = self.skinning.skin(prim.prim, points)
        read = read_mesh(prim, points, detail, self.report)
        if read is not None and skin is not None and read[0].normals is not None:
            mesh, topology = read
            # Authored normals follow the joints; subdivision surfaces are made of skinned points.
            if prim["subdivisionScheme"] == UsdGeom.Tokens.none:
                mesh.normals = skin.primvar(mesh.normals, topology)
        return read, skin

    def _assign_materials(
        self,
        prim: Attributes,
        mesh: Mesh,
        topology: Spreads,
        material: UsdShade.Material | None,
    ) -> None:
        default = self._material(prim, material)
        subsets = []
        if prim.prim.GetChildrenNames():
            subsets = self._subsets(prim, default)
        mesh.materials = face_materials(topology, default, subsets)
        if not prim.names.isdisjoint(GEOMETRY_ATTRIBUTES):
            mesh.light_group = light_group(prim.prim, GEOMETRY_ATTRIBUTES)
        names = sorted(self.primvars_kept.union(self.materials.primvars_of(mesh)))
        primvars = self.primvars.read(prim, names, topology)
        mesh.primvars = {
            name: primvars.get(name, mesh.primvars.get(name))
            for name in names
            if name in primvars or name in mesh.primvars
        }

    def _material(self, prim: Attributes, material: UsdShade.Material | None) -> int:
        index = None if material is None else self.materials.index(material)
        if index is None:
            index = self.materials.fallback(self._shows_through(prim))
        return index

    def _shows_through(self, prim: Attributes) -> bool:
        """Whether some displayOpacity is below 1."""
        own = self.primvars.own(prim, "displayOpacity")
        if own is not None:
            values = own.Get(self.time)
        else:
            inherited = self.primvars.inherited(prim.prim.GetParent(), "displayOpacity")
            values = inherited and inherited[1]
        return values is not None and bool(np.any(np.less(values, 1)))

    def _subsets(self, prim: Attributes, default: int) -> list[tuple[Usd.Prim, np.ndarray, int]]:
        """The face subsets that bind materials: prim, faces and material."""
        subsets = UsdShade.MaterialBindingAPI(prim.prim).GetMaterialBindSubsets()
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
