"""Walking the stage: what is visible, of a purpose that is rendered, and where it is.

The walk sorts prims into a :class:`Group` each for the world and for every prototype. Native
instances and point instancers are not entered; ``instancing`` makes groups of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdVol

from usdmlt.errors import Report
from usdmlt.scene import Light, Mesh
from usdmlt.stage import gprims, lights, tessellated
from usdmlt.stage.attributes import authored_names
from usdmlt.stage.draw_modes import STAND_IN, draw_mode
from usdmlt.stage.motion import Shutter
from usdmlt.stage.points import alike
from usdmlt.stage.render_passes import PassVisibility
from usdmlt.stage.skinning import Skinning

IDENTITY = Gf.Matrix4d(1.0)

# Defined or not, abstract or not: prototypes of point instancers are often kept in overs and
# classes so that nothing else draws them.
PROTOTYPE_CHILDREN = Usd.TraverseInstanceProxies(
    Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier
)
CHILDREN = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


@dataclass(slots=True)
class Placed:
    """A prim, what it is, the names of its authored properties (None: not known), and its transform
    to the space of its group; where that changes while the shutter is open, ``motion``
    (times, 4, 4). ``blur``: motion:blurScale, by which the shutter is scaled."""

    prim: Usd.Prim
    kind: str
    transform: Gf.Matrix4d
    purpose: str
    motion: np.ndarray | None = None
    names: frozenset[str] | None = None
    blur: float = 1.0

    @property
    def matrix(self) -> np.ndarray:
        """The transform as (4, 4) float64."""
        return np.array(self.transform, dtype=np.float64)


@dataclass
class Placements:
    """Where something is: ``transforms`` (n, 4, 4); ``values``: primvars of each placement by name,
    (n, width), NaN where there is none; ``motion`` (times, n, 4, 4) if any of them moves."""

    transforms: np.ndarray
    values: dict[str, np.ndarray] = field(default_factory=dict)
    motion: np.ndarray | None = None


@dataclass
class Group:
    """What the world or a prototype holds, in its own space."""

    name: str
    from_world: Gf.Matrix4d = field(default_factory=lambda: Gf.Matrix4d(1.0))
    gprims: list[Placed] = field(default_factory=list)
    lights: list[Placed] = field(default_factory=list)
    volumes: list[Placed] = field(default_factory=list)  # of fields
    instances: list[Placed] = field(default_factory=list)  # of native prototypes
    instancers: list[Placed] = field(default_factory=list)
    points: list[Placed] = field(default_factory=list)  # that are instances of one sphere
    children: list[tuple[Group, Placements]] = field(default_factory=list)
    drawn_by: tuple[Sdf.Path, ...] = ()  # point instancers, from the outermost on
    # Where all of it is in the world; filled in once all groups are known:
    placements: Placements = field(default_factory=lambda: Placements(np.empty((0, 4, 4))))
    # Filled in once the prims are read:
    scene_meshes: list[Mesh] = field(default_factory=list)
    scene_lights: list[Light] = field(default_factory=list)
    scene_volumes: list[Mesh] = field(default_factory=list)  # without a surface


@dataclass(frozen=True)
class PrimKind:
    """What a prim type means to the walk."""

    # "mesh", "gprim", "volume", "light", "instancer", "skeleton root", "unsupported", ""
    role: str
    name: str = ""
    imageable: bool = False
    xformable: bool = False
    descend: bool = True


# Transforms at the times of the shutter; None for what stays.
Moved = list[Gf.Matrix4d] | None


def as_array(moved: Moved) -> np.ndarray | None:
    """(times, 4, 4) float64."""
    return None if moved is None else np.array([np.array(matrix) for matrix in moved])


BLUR_SCALE = "motion:blurScale"

# What is below these may have a purpose of its own.
_ANY_PURPOSE = ("instancer", "skeleton root")


class Traversal:
    """Walks one stage at one time. ``draw_modes``: whether models are drawn as they ask for;
    ``visibility``: what of it a render pass leaves."""

    def __init__(
        self,
        time: Usd.TimeCode,
        purposes: tuple[str, ...],
        skinning: Skinning,
        report: Report,
        draw_modes: bool = True,
        visibility: PassVisibility | None = None,
        shutter: Shutter | None = None,
    ):
        self.shutter = shutter or Shutter(time)
        self._xforms_at: dict[float, list[UsdGeom.XformCache]] = {}
        self.time = time
        self.visibility = visibility or PassVisibility(None, report)
        self.draw_modes = draw_modes
        self.purposes = {"default", *purposes}
        self.skinning = skinning
        self.report = report
        self.xforms = UsdGeom.XformCache(time)
        self._kinds: dict[str, PrimKind] = {}

    def walk(
        self,
        group: Group,
        roots: list[Usd.Prim],
        purpose: str = "default",
        predicate=CHILDREN,
    ) -> None:
        """Sort ``roots`` and all below them into ``group``. ``purpose``: of their parent."""
        stack: list[tuple[Usd.Prim, Gf.Matrix4d, str, Moved, float, tuple[Usd.Prim, ...]]]
        stack = [
            (prim, IDENTITY, purpose, None, self._blur_above(prim), ()) for prim in reversed(roots)
        ]
        while stack:
            prim, transform, purpose, moved, blur, above = stack.pop()
            if self.visibility.prunes(prim):
                continue
            kind = self._kind(prim)
            names = authored_names(prim)
            if kind.imageable:
                if "visibility" in names and self._is_invisible(prim):
                    continue
                if "purpose" in names and prim.GetAttribute("purpose").HasAuthoredValue():
                    purpose = str(prim.GetAttribute("purpose").Get())
            if BLUR_SCALE in names and self.shutter.opens:
                own = self._blur_scale(prim, blur)
                if own != blur:
                    blur, moved = own, self._moved_above(above, group, own)
            if kind.xformable and "xformOpOrder" in names:
                local, resets = self.xforms.GetLocalTransformation(prim)
                outer = group.from_world if resets else transform
                moved = self._moved(prim, local, outer, None if resets else moved, blur)
                transform = local * outer
                above = (*above, prim)
            placed = Placed(prim, kind.name, transform, purpose, as_array(moved), names, blur)
            if self.draw_modes and draw_mode(prim):
                placed.kind = STAND_IN
                if purpose in self.purposes and self._shows(prim, purpose):
                    group.gprims.append(placed)
                continue
            if prim.IsInstance():
                if not self._is_hidden(prim, purpose):
                    group.instances.append(placed)
                continue
            shown = purpose in self.purposes or kind.role in _ANY_PURPOSE
            if kind.role and shown and self._shows(prim, purpose):
                self._sort(group, placed, kind)
            if kind.descend:
                children = prim.GetFilteredChildren(predicate)
                stack.extend(
                    (child, transform, purpose, moved, blur, above) for child in reversed(children)
                )

    def _is_invisible(self, prim: Usd.Prim) -> bool:
        return prim.GetAttribute("visibility").Get(self.time) == UsdGeom.Tokens.invisible

    def _shows(self, prim: Usd.Prim, purpose: str) -> bool:
        return self.visibility.shows(prim) and not self._is_hidden(prim, purpose)

    def _is_hidden(self, prim: Usd.Prim, purpose: str) -> bool:
        """Whether the nearest opinion on the visibility of a purpose (UsdGeomVisibilityAPI) hides
        it. Guides that are asked for are shown where there is none."""
        if purpose == "default":
            return False
        name = f"{purpose}Visibility"
        while prim and not prim.IsPseudoRoot():
            attribute = prim.GetAttribute(name)
            if attribute and attribute.HasAuthoredValue():
                return bool(attribute.Get(self.time) == UsdGeom.Tokens.invisible)
            prim = prim.GetParent()
        return False

    def _blur_above(self, prim: Usd.Prim) -> float:
        """What a prim inherits of motion:blurScale."""
        parent = prim.GetParent()
        if not self.shutter.opens or not parent:
            return 1.0
        scale = UsdGeom.MotionAPI(parent).ComputeMotionBlurScale(self.time)
        return float(scale) if np.isfinite(scale) and scale >= 0 else 1.0

    def _blur_scale(self, prim: Usd.Prim, inherited: float) -> float:
        """motion:blurScale of a prim that has an opinion on it."""
        attribute = prim.GetAttribute(BLUR_SCALE)
        scale = attribute.Get(self.time) if attribute.HasAuthoredValue() else None
        if scale is None:
            return inherited
        if not isinstance(scale, float) or not np.isfinite(scale) or scale < 0:
            self.report.warn(
                "blurScale is ignored where it is no number of at least 0", prim.GetPath()
            )
            return inherited
        return scale

    def _caches(self, blur: float) -> list[UsdGeom.XformCache]:
        if blur not in self._xforms_at:
            codes = self.shutter.scaled(blur).codes
            self._xforms_at[blur] = [UsdGeom.XformCache(code) for code in codes]
        return self._xforms_at[blur]

    def _moved_above(self, above: tuple[Usd.Prim, ...], group: Group, blur: float) -> Moved:
        """The transforms of a parent to its group, at the times of a shutter scaled by ``blur``."""
        caches = self._caches(blur)
        result = [IDENTITY] * len(caches)
        for prim in above:  # from the outermost on
            for index, cache in enumerate(caches):
                local, resets = cache.GetLocalTransformation(prim)
                result[index] = local * (group.from_world if resets else result[index])
        return result or None

    def _moved(
        self,
        prim: Usd.Prim,
        local: Gf.Matrix4d,
        outer: Gf.Matrix4d,
        outer_moved: Moved,
        blur: float,
    ) -> Moved:
        """The transforms of a prim to its group at the times of the shutter; None if it stays."""
        if not self.shutter.opens:
            return None
        caches = self._caches(blur)
        if not caches:
            return None
        varies = UsdGeom.Xformable(prim).TransformMightBeTimeVarying()
        if not varies and outer_moved is None:
            return None
        times = len(caches)
        locals_ = [local] * times
        if varies:
            locals_ = [cache.GetLocalTransformation(prim)[0] for cache in caches]
        outers = outer_moved or [outer] * times
        return [a * b for a, b in zip(locals_, outers, strict=True)]

    def _sort(self, group: Group, placed: Placed, kind: PrimKind) -> None:
        prim = placed.prim
        if kind.name == "Points" and alike(prim):
            group.points.append(placed)
        elif kind.role in ("mesh", "gprim"):
            group.gprims.append(placed)
        elif kind.role == "volume":
            group.volumes.append(placed)
        elif kind.role == "light":
            group.lights.append(placed)
        elif kind.role == "instancer":
            group.instancers.append(placed)
        elif kind.role == "skeleton root":
            self.skinning.add_root(prim)
        elif kind.role == "unsupported":
            self.report.warn(f"{kind.name} prims are not rendered", prim.GetPath())

    def _kind(self, prim: Usd.Prim) -> PrimKind:
        name = prim.GetTypeName()
        if name not in self._kinds:
            self._kinds[name] = classify(prim, str(name))
        return self._kinds[name]


def classify(prim: Usd.Prim, name: str) -> PrimKind:
    """What prims of a type are to the walk, decided once per type."""
    imageable, xformable = prim.IsA(UsdGeom.Imageable), prim.IsA(UsdGeom.Xformable)

    def kind(role: str, descend: bool = True) -> PrimKind:
        return PrimKind(role, name, imageable, xformable, descend)

    if prim.IsA(UsdGeom.Mesh):
        return kind("mesh")
    if name in gprims.READERS or name in tessellated.READERS:
        return kind("gprim")
    if prim.IsA(UsdVol.Volume):
        return kind("volume")
    if name in lights.READERS:
        return kind("light")
    if prim.IsA(UsdGeom.PointInstancer):
        return kind("instancer", descend=False)
    if prim.IsA(UsdSkel.Root):
        return kind("skeleton root")
    if prim.IsA(UsdShade.Material) or prim.IsA(UsdShade.NodeGraph) or prim.IsA(UsdShade.Shader):
        return kind("", descend=False)
    if prim.IsA(UsdSkel.Skeleton) or prim.IsA(UsdGeom.Camera):
        return kind("")
    if prim.IsA(UsdGeom.Boundable) or (name and prim.HasAPI(UsdLux.LightAPI)):
        return kind("unsupported")
    if name and Usd.SchemaRegistry().FindConcretePrimDefinition(name) is None:
        return kind("unsupported")
    return kind("")
