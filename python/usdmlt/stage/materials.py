"""Materials: which render context is read, the surfaces that are known, what they are filled with,
and the fallback."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import fields, is_dataclass

import numpy as np
from pxr import Usd, UsdShade

from usdmlt.errors import Report
from usdmlt.scene import (
    Add,
    Closure,
    Diffuse,
    Layer,
    Material,
    Medium,
    Mesh,
    Mix,
    Multiply,
    Node,
    PreviewSurface,
    PrimvarInput,
    TextureInput,
    UniformEmission,
)
from usdmlt.stage.interiors import INTERIORS
from usdmlt.stage.materialx import read_surface, read_unlit
from usdmlt.stage.materialx_volumes import read_volume
from usdmlt.stage.networks import (
    Networks,
    Unusable,
    follow_no_circle,
    is_zero,
    node_id,
    undeclared_output,
)
from usdmlt.stage.open_pbr_surface import read_open_pbr_surface
from usdmlt.stage.preview_surface import read_preview_surface
from usdmlt.stage.standard_surface import read_standard_surface

# The surface nodes that are rendered. The MaterialX context comes first where it is one of them.
SURFACES: dict[str, Callable[[Networks, UsdShade.Shader], Material]] = {
    "UsdPreviewSurface": read_preview_surface,
    "ND_UsdPreviewSurface_surfaceshader": read_preview_surface,
    "ND_surface": read_surface,
    "ND_surface_unlit": read_unlit,
    "ND_standard_surface_surfaceshader": read_standard_surface,
    "ND_standard_surface_surfaceshader_100": read_standard_surface,
    "ND_open_pbr_surface_surfaceshader": read_open_pbr_surface,
}
VOLUMES = ("ND_volume",)
CONTEXTS = ("mtlx", "")
GREY = (0.18, 0.18, 0.18)
MAX_LOBES = 8  # of the core


class Materials:
    """The materials of a scene, each read once.

    ``media``: those of the scene; ``interiors``: by the index of a material, the one that meshes of
    it are filled with; ``without_surface``: the materials that are nothing else.
    """

    def __init__(self, networks: Networks, report: Report):
        self.networks = networks
        self.report = report
        self.materials: list[Material] = []
        self.media: list[Medium] = []
        self.interiors: dict[int, int] = {}
        self.without_surface: set[int] = set()
        self._indices: dict[Usd.Prim, int | None] = {}
        self._volumes: dict[Usd.Prim, int | None] = {}
        self._fallbacks: dict[bool, int] = {}
        self._primvars: dict[int, list[str]] = {}

    def index(self, material: UsdShade.Material) -> int | None:
        """The index of a material; None, with a warning, if there is nothing of it to render."""
        prim = material.GetPrim()
        if prim not in self._indices:
            # Materials inside of instances are the same for all of their prototype.
            shared = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
            if shared not in self._indices:
                self._indices[shared] = self._added(material)
            self._indices[prim] = self._indices[shared]
        return self._indices[prim]

    def fallback(self, with_opacity: bool) -> int:
        """The material of meshes that have none: diffuse, displayColor and displayOpacity."""
        if with_opacity not in self._fallbacks:
            material = Material(
                Diffuse(color=PrimvarInput("displayColor", GREY)),
                opacity=PrimvarInput("displayOpacity", 1.0) if with_opacity else 1.0,
                name="displayColor",
            )
            self._fallbacks[with_opacity] = self._append(material)
        return self._fallbacks[with_opacity]

    def primvars(self, index: int) -> list[str]:
        """The primvars that a material reads, in order."""
        if index not in self._primvars:
            names = {name for name in _primvar_names(self.materials[index]) if name}
            self._primvars[index] = sorted(names)
        return self._primvars[index]

    def primvars_of(self, mesh: Mesh) -> list[str]:
        """The primvars that the materials of a mesh read, in order."""
        if not isinstance(mesh.materials, np.ndarray):
            return self.primvars(mesh.materials)
        return sorted(set().union(*map(self.primvars, np.unique(mesh.materials).tolist())))

    def add(self, material: Material) -> int:
        """The index of a material that no prim has."""
        return self._append(material)

    def add_medium(self, medium: Medium) -> int:
        """The index of a medium."""
        self.media.append(medium)
        return len(self.media) - 1

    def volume_index(self, material: UsdShade.Material) -> int | None:
        """The index of the medium of a material's volume output, which is read once."""
        prim = material.GetPrim()
        shared = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        if shared not in self._volumes:
            medium = self.volume(material)
            self._volumes[shared] = None if medium is None else self.add_medium(medium)
        return self._volumes[shared]

    def volume(self, material: UsdShade.Material, density: str = "") -> Medium | None:
        """The medium of a material's volume output; None, with a warning if it cannot be rendered,
        where there is none. ``density``: the primvar that counts as 1."""
        outputs = [material.GetVolumeOutput(context) for context in CONTEXTS]
        outputs = [o for o in outputs if o and o.GetAttr().HasAuthoredConnections()]
        if not outputs:
            return None
        self.networks.refuse_unknown = False
        try:
            shader = self._shader(outputs[0], VOLUMES, "volume")
            medium = read_volume(self.networks, shader, density)
        except Unusable as reason:
            self.report.warn(reason.reason, reason.path)
            return None
        medium.name = str(material.GetPath())
        return medium

    def _append(self, material: Material) -> int:
        self.materials.append(material)
        return len(self.materials) - 1

    def _added(self, material: UsdShade.Material) -> int | None:
        surface, inside = self._surface(material)
        medium = self.volume_index(material)
        if medium is None and inside is not None:
            medium = self.add_medium(inside)
        if surface is not None:
            index = self._append(surface)
        elif medium is None or any(o.HasConnectedSource() for o in material.GetSurfaceOutputs()):
            return None
        else:
            index = self._append(Material(None, opacity=0.0, name=str(material.GetPath())))
            self.without_surface.add(index)
        if medium is not None and not self.materials[index].thin_walled:
            self.interiors[index] = medium
        return index

    def _surface(self, material: UsdShade.Material) -> tuple[Material | None, Medium | None]:
        """The surface of a material and what is inside of it."""
        path = material.GetPath()
        outputs = [material.GetSurfaceOutput(context) for context in CONTEXTS]
        outputs = [o for o in outputs if o and o.GetAttr().HasAuthoredConnections()]
        unusable = []
        for output in outputs:
            # A graph with nodes that are not known is left for the next context, if there is one.
            self.networks.refuse_unknown = output is not outputs[-1]
            try:
                shader = self._shader(output, SURFACES, "surface")
                read = SURFACES[node_id(shader)](self.networks, shader)
                if lobe_count(read.closure) > MAX_LOBES:
                    raise Unusable(
                        f"surfaces of more than {MAX_LOBES} lobes are not rendered", path
                    )
                inside = self._interior(shader, read)
            except Unusable as reason:
                unusable.append(reason)
                continue
            read.name = str(path)
            return read, inside
        for reason in unusable:
            self.report.warn(reason.reason, reason.path)
        if not unusable:
            self._warn_without_surface(material)
        return None, None

    def _interior(self, shader: UsdShade.Shader, surface: Material) -> Medium | None:
        read = INTERIORS.get(node_id(shader))
        if read is None or surface.thin_walled:
            return None
        medium = read(self.networks, shader)
        if medium is not None:
            medium.name = str(shader.GetPath())
        return medium

    def _shader(
        self, output: UsdShade.Output, known: Collection[str], what: str
    ) -> UsdShade.Shader:
        """The shader behind an output of a material, through node graphs: one of ``known``."""
        attribute = output.GetAttr()
        follow_no_circle(attribute)
        sources = UsdShade.Utils.GetValueProducingAttributes(output, shaderOutputsOnly=True)
        undeclared = undeclared_output(attribute)
        if sources:
            shader = UsdShade.Shader(sources[0].GetPrim())
        elif undeclared is not None:
            shader = undeclared.shader
        else:
            raise Unusable(f"materials whose {what} is connected to nothing", attribute.GetPath())
        node = node_id(shader)
        if node not in known:
            raise Unusable(
                f"{what} shaders of type {node or '(no identifier)'} are not rendered",
                shader.GetPath(),
            )
        return shader

    def _warn_without_surface(self, material: UsdShade.Material) -> None:
        """A material without a surface we know of says so; one that is only a volume has."""
        contexts = sorted(
            {output.GetBaseName().split(":")[0] for output in material.GetSurfaceOutputs()}
            - {"surface", "mtlx"}
        )
        if contexts:
            self.report.warn(
                f"materials for other renderers only ({', '.join(contexts)})", material.GetPath()
            )
        elif not any(o.HasConnectedSource() for o in material.GetVolumeOutputs()):
            self.report.warn("materials without a surface", material.GetPath())


def _primvar_names(node: object, seen: set[int] | None = None) -> Iterator[str]:
    """The primvars of all inputs below a dataclass of the scene description."""
    seen = set() if seen is None else seen
    if id(node) in seen:
        return
    seen.add(id(node))
    if isinstance(node, (TextureInput, PrimvarInput)):
        yield node.primvar
    if isinstance(getattr(node, "roughness", None), tuple):
        yield "st"  # anisotropy runs along it
    if isinstance(node, Node):
        for item in node.inputs:
            yield from _primvar_names(item, seen)
    elif isinstance(node, tuple):
        for item in node:
            yield from _primvar_names(item, seen)
    elif is_dataclass(node):
        for field in fields(node):
            yield from _primvar_names(getattr(node, field.name), seen)


def lobe_count(closure: object) -> int:
    """The most lobes that a closure can have."""
    if isinstance(closure, PreviewSurface):
        return 2 + (not is_zero(closure.clearcoat)) + (closure.opacity != 1.0)
    if not is_dataclass(closure) or isinstance(closure, UniformEmission):
        return 0
    if not isinstance(closure, (Layer, Mix, Add, Multiply)):
        return 1
    return sum(
        lobe_count(getattr(closure, f.name))
        for f in fields(closure)
        if f.name not in ("mix", "factor")
    )


def emits(material: Material) -> bool:
    """Whether a material gives off light."""
    return _closure_emits(material.closure)


def _closure_emits(closure: Closure | None) -> bool:
    if isinstance(closure, PreviewSurface):
        return not is_zero(closure.emissiveColor)
    if isinstance(closure, UniformEmission):
        return not is_zero(closure.color)
    if closure is None or not is_dataclass(closure):
        return False
    return any(_closure_emits(getattr(closure, f.name)) for f in fields(closure))


def bound_materials(
    prims: list[Usd.Prim], purpose: str, report: Report
) -> list[UsdShade.Material | None]:
    """The material bound to each prim, resolved by USD; None, with a warning, for missing ones."""
    if not prims:
        return []
    materials, relationships = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims, purpose)
    result = []
    for prim, material, relationship in zip(prims, materials, relationships, strict=True):
        if material:
            result.append(material)
            continue
        result.append(None)
        if relationship and relationship.GetTargets():
            target = relationship.GetTargets()[0]
            report.warn("bound materials are missing", f"{prim.GetPath()} ({target})")
    return result
