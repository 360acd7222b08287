"""Native instances and point instancers as groups and where these are placed.

Instances share a group when they would look the same: they have the same USD prototype and
inherit the same material, purpose and constant primvars from outside of it, and the same lights
are linked to what is inside.
"""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from usdmlt.errors import Error, Report
from usdmlt.stage.color import ColorSpaces
from usdmlt.stage.flattening import place
from usdmlt.stage.gprims import POINT_SPHERE
from usdmlt.stage.instance_motion import instance_motion, placed_motion, sphere_motion
from usdmlt.stage.light_links import LightLinks, linked_lights
from usdmlt.stage.motion import stacked
from usdmlt.stage.points import read_spheres, sphere_transforms
from usdmlt.stage.primvars import read_values
from usdmlt.stage.transforms import singular
from usdmlt.stage.traversal import (
    CHILDREN,
    IDENTITY,
    PROTOTYPE_CHILDREN,
    Group,
    Placed,
    Placements,
    Traversal,
)

BINDING = "material:binding"
INHERITED = (BINDING, "primvars:")


class Instancing:
    """Collects the groups of a stage: the world and every prototype, each walked once."""

    def __init__(
        self,
        stage: Usd.Stage,
        traversal: Traversal,
        colors: ColorSpaces,
        material_purpose: str,
        report: Report,
        links: LightLinks | None = None,
    ):
        self.stage = stage
        self.traversal = traversal
        self.time = traversal.time
        self.colors = colors
        self.material_purpose = material_purpose
        self.report = report
        self.links = links or LightLinks()
        self.groups: list[Group] = []
        self._by_key: dict[Hashable, Group] = {}
        self._collections: dict[Usd.Prim, bool] = {}
        self._shader_primvars: set[str] | None = None

    def collect(self) -> Group:
        """Walk the stage. Returns the world; :attr:`groups` has all groups, the world first."""
        world = Group("/")
        self.traversal.walk(world, self.stage.GetPseudoRoot().GetFilteredChildren(CHILDREN))
        self.groups.append(world)
        checked: set[Sdf.Path] = set()
        for group in self.groups:  # grows while it is walked
            for instancer in group.instancers:
                refuse_circles(instancer.prim, (), checked)
            self._resolve_instances(group)
            for instancer in group.instancers:
                self._resolve_instancer(group, instancer)
            for points in group.points:
                self._resolve_points(group, points)
        place(world)
        return world

    # -- native instances

    def _resolve_instances(self, group: Group) -> None:
        placements: dict[Hashable, list[Placed]] = {}
        for placed, inherited in zip(
            group.instances, self._inherited(group.instances), strict=True
        ):
            key = (placed.prim.GetPrototype(), placed.purpose, inherited)
            if self.links:
                key = (key, group.drawn_by, self.links.seen_inside(placed.prim, group.drawn_by))
            placements.setdefault(key, []).append(placed)
        for key, instances in placements.items():
            transforms = np.array([np.array(placed.transform) for placed in instances])
            for index in np.flatnonzero(singular(transforms)):
                raise Error(f"{instances[index].prim.GetPath()}: the transform is singular")
            if key not in self._by_key:
                self._by_key[key] = self._walk_instance(group, instances[0])
            motion = stacked(transforms, [placed.motion for placed in instances])
            group.children.append((self._by_key[key], Placements(transforms, motion=motion)))

    def _walk_instance(self, outer: Group, placed: Placed) -> Group:
        """A new group of what is below an instance, seen through its proxies."""
        prim = placed.prim
        to_world = self.traversal.xforms.GetLocalToWorldTransform(prim)
        group = Group(
            str(prim.GetPath()), from_world=to_world.GetInverse(), drawn_by=outer.drawn_by
        )
        self.traversal.walk(group, prim.GetFilteredChildren(CHILDREN), placed.purpose)
        self.groups.append(group)
        return group

    def _inherited(self, instances: list[Placed]) -> list[Hashable]:
        """Of each instance, what those have in common that look the same: the material they are
        bound to, how strongly, and primvars. What an instance says nothing of itself is its
        parent's, and found once for all that are below it."""
        where = [self._speaker(placed) for placed in instances]
        distinct = list(dict.fromkeys(where))
        bound = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(distinct, self.material_purpose)
        keys = {
            prim: self._key(prim, material, relationship)
            for prim, material, relationship in zip(distinct, *bound, strict=True)
        }
        return [keys[prim] for prim in where]

    def _speaker(self, placed: Placed) -> Usd.Prim:
        """The prim that has what an instance inherits: itself, or its parent."""
        prim, parent = placed.prim, placed.prim.GetParent()
        if placed.names is None or any(name.startswith(INHERITED) for name in placed.names):
            return prim
        return prim if parent.IsPseudoRoot() or self._has_collection_bindings(parent) else parent

    def _key(self, prim: Usd.Prim, material: UsdShade.Material, relationship) -> Hashable:
        strength = None
        if relationship:
            strength = str(UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(relationship))
        key = (
            str(material.GetPath()) if material else "",
            strength,
            self._inherited_primvars(prim),
        )
        if not self._has_collection_bindings(prim):
            return key
        # A collection may tell apart what is inside: compare all the bindings there.
        inside = Usd.PrimRange(prim, CHILDREN)
        below = [p for p in inside if p.IsA(UsdGeom.Gprim) or p.IsA(UsdGeom.Subset)]
        materials, _ = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(
            below, self.material_purpose
        )
        return (*key, tuple(str(m.GetPath()) if m else "" for m in materials))

    def _has_collection_bindings(self, prim: Usd.Prim) -> bool:
        """Whether a prim or one above it binds materials by collections."""
        if not prim or prim.IsPseudoRoot():
            return False
        if prim not in self._collections:
            names = prim.GetAuthoredPropertiesInNamespace(BINDING)
            own = any(p.GetName().startswith(f"{BINDING}:collection") for p in names)
            self._collections[prim] = own or self._has_collection_bindings(prim.GetParent())
        return self._collections[prim]

    def _inherited_primvars(self, prim: Usd.Prim) -> Hashable:
        """The constant primvars an instance hands down, of those that materials may read."""
        primvars = UsdGeom.PrimvarsAPI(prim).FindInheritablePrimvars()
        found = []
        for primvar in primvars:
            name = str(primvar.GetPrimvarName())
            if name in self._primvars_read():
                value = np.asarray(primvar.ComputeFlattened(self.time))
                found.append((name, str(value.dtype), value.tobytes()))
        return tuple(found)

    def _primvars_read(self) -> set[str]:
        """The names of primvars that shaders anywhere on the stage read."""
        if self._shader_primvars is None:
            names = {"displayColor", "displayOpacity", "st", "normals"}
            for root in (self.stage.GetPseudoRoot(), *self.stage.GetPrototypes()):
                for prim in Usd.PrimRange.AllPrims(root):
                    if prim.GetTypeName() == "Shader":
                        names |= _names_read(UsdShade.Shader(prim), self.time)
            self._shader_primvars = names
        return self._shader_primvars

    # -- point instancers

    def _resolve_instancer(self, group: Group, placed: Placed) -> None:
        prim = placed.prim
        instancer, path = UsdGeom.PointInstancer(prim), prim.GetPath()
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        which = np.asarray(instancer.GetProtoIndicesAttr().Get(self.time) or [], dtype=np.int64)
        if not len(which):
            return
        if not (which.min() >= 0 and which.max() < len(targets)):
            worst = which.min() if which.min() < 0 else which.max()
            raise Error(
                f"{path}: protoIndices has {worst}, but there are {len(targets)} prototypes"
            )
        transforms = instancer.ComputeInstanceTransformsAtTime(
            self.time,
            self.time,
            UsdGeom.PointInstancer.ExcludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )
        transforms = np.array(transforms, dtype=np.float64).reshape(-1, 4, 4)
        if len(transforms) != len(which):
            raise Error(f"{path}: positions, orientations or scales do not match protoIndices")
        visible = np.ones(len(which), dtype=bool)
        mask = instancer.ComputeMaskAtTime(self.time)
        if len(mask):
            visible = np.asarray(mask, dtype=bool)
        if not np.isfinite(transforms[visible]).all():
            raise Error(f"{path}: positions, orientations or scales are not finite")
        flat = visible & singular(transforms)
        if flat.any():
            self.report.note("point instances scaled to nothing are left out", path)
            visible &= ~flat
        values = self._instance_primvars(instancer, len(which))

        if singular(placed.matrix):
            raise Error(f"{path}: the transform is singular")
        motion = None
        shutter = self.traversal.shutter.scaled(placed.blur)
        if shutter.opens:
            own = instance_motion(instancer, len(which), shutter, self.report)
            motion = placed_motion(transforms, own, placed)
        transforms = transforms @ placed.matrix
        for index in np.unique(which[visible]):
            child = self._prototype(group, instancer, targets[index], placed)
            if child is not None:
                chosen = visible & (which == index)
                own = {name: value[chosen] for name, value in values.items()}
                moving = None if motion is None else motion[:, chosen]
                group.children.append((child, Placements(transforms[chosen], own, moving)))

    def _prototype(
        self, outer: Group, instancer: UsdGeom.PointInstancer, target: Sdf.Path, placed: Placed
    ) -> Group | None:
        """The group of a prototype of an instancer, its own transform included."""
        prim = self.stage.GetPrimAtPath(target)
        if not prim:
            raise Error(f"{instancer.GetPath()}: its prototype {target} does not exist")
        if not prim.IsActive():
            return None
        drawn_by = (*outer.drawn_by, instancer.GetPath())
        key = ("point instancer", str(instancer.GetPath()), str(target), placed.purpose)
        if self.links:
            key = (key, drawn_by)
        if key not in self._by_key:
            to_world = self.traversal.xforms.GetParentToWorldTransform(prim)
            group = Group(str(target), from_world=to_world.GetInverse(), drawn_by=drawn_by)
            self.traversal.walk(group, [prim], placed.purpose, PROTOTYPE_CHILDREN)
            self.groups.append(group)
            self._by_key[key] = group
        return self._by_key[key]

    def _resolve_points(self, group: Group, placed: Placed) -> None:
        """UsdGeomPoints that look alike: a group of one sphere, many times."""
        read = read_spheres(placed.prim, self.time, self.report)
        if read is None:
            return
        if singular(placed.matrix):
            raise Error(f"{placed.prim.GetPath()}: the transform is singular")
        transforms = sphere_transforms(*read)
        motion = None
        shutter = self.traversal.shutter.scaled(placed.blur)
        if shutter.opens:
            own = sphere_motion(placed.prim, len(transforms), shutter, self.report)
            motion = placed_motion(transforms, own, placed)
        if not len(transforms):
            self.report.note("shapes without extent are left out", placed.prim.GetPath())
            return
        sphere = Placed(placed.prim, POINT_SPHERE, IDENTITY, placed.purpose)
        child = Group(str(placed.prim.GetPath()), gprims=[sphere], drawn_by=group.drawn_by)
        self.groups.append(child)
        group.children.append((child, Placements(transforms @ placed.matrix, motion=motion)))

    def _instance_primvars(
        self, instancer: UsdGeom.PointInstancer, count: int
    ) -> dict[str, np.ndarray]:
        """The primvars that differ between instances and that shaders may read: (count, width)."""
        found = {}
        for primvar in UsdGeom.PrimvarsAPI(instancer).GetPrimvarsWithAuthoredValues():
            name = str(primvar.GetPrimvarName())
            if primvar.GetInterpolation() == UsdGeom.Tokens.constant:
                continue
            if name not in self._primvars_read():
                continue
            path = primvar.GetAttr().GetPath()
            values = read_values(primvar, self.time, self.colors, self.report)
            indices = np.asarray(primvar.GetIndices(self.time)) if primvar.IsIndexed() else None
            if values is None:
                continue
            if indices is not None and len(indices):
                if not (indices.min() >= 0 and indices.max() < len(values)):
                    raise Error(f"{path}: primvar indices out of range (0 to {len(values) - 1})")
                values = values[indices]
            if len(values) != count:
                self.report.warn(
                    "primvars whose number of values does not fit their interpolation are ignored",
                    f"{path} ({len(values)} {primvar.GetInterpolation()})",
                )
                continue
            found[name] = values.astype(np.float64)
        return found


def collect_groups(
    stage: Usd.Stage,
    traversal: Traversal,
    colors: ColorSpaces,
    material_purpose: str,
    report: Report,
) -> tuple[list[Group], LightLinks]:
    """The groups of a stage, the world first, and what its lights are linked to.

    Which instances links tell apart is known when all lights are: the stage is then walked again.
    """
    instancing = Instancing(stage, traversal, colors, material_purpose, report)
    instancing.collect()
    links = LightLinks(linked_lights(stage, instancing.groups))
    if links and len(instancing.groups) > 1:
        instancing = Instancing(stage, traversal, colors, material_purpose, report, links)
        instancing.collect()
    return instancing.groups, links


def _names_read(shader: UsdShade.Shader, time: Usd.TimeCode) -> set[str]:
    """The primvar a reader node names."""
    names = set()
    for name in ("varname", "geomprop"):
        shader_input = shader.GetInput(name)
        if shader_input:
            for attribute in shader_input.GetValueProducingAttributes():
                names.add(str(attribute.Get(time)))
    return names


def refuse_circles(
    instancer: Usd.Prim, inside: tuple[Sdf.Path, ...], checked: set[Sdf.Path]
) -> None:
    """Raise :class:`Error` for a point instancer in one of its own prototypes, whether anything is
    drawn there or not: USD would compute its bounds without end."""
    path = instancer.GetPath()
    if path in inside:
        raise Error(f"{path}: a prototype that contains itself")
    if path in checked:
        return
    checked.add(path)
    everything = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    for target in UsdGeom.PointInstancer(instancer).GetPrototypesRel().GetForwardedTargets():
        prototype = instancer.GetStage().GetPrimAtPath(target)
        for prim in Usd.PrimRange(prototype, everything) if prototype else ():
            if prim.IsA(UsdGeom.PointInstancer):
                refuse_circles(prim, (*inside, path), checked)
