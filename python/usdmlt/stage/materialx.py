"""MaterialX surfaces built from the BSDF and EDF nodes of its PBR library.

A reader takes (graph, shader) and returns a closure of the scene description. Input names and
defaults are those of MaterialX's pbrlib definitions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from pxr import Sdf, UsdShade

from usdmlt.scene import (
    Add,
    Closure,
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Input,
    Layer,
    Material,
    Mix,
    Multiply,
    Node,
    Sheen,
    TextureInput,
    Translucent,
    UniformEmission,
)
from usdmlt.stage.expressions import is_constant, lane, multiply, subtract
from usdmlt.stage.materialx_normals import read_normal
from usdmlt.stage.networks import Kind, Networks, Unusable, entered, is_zero

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


@dataclass
class Graph:
    """A graph of closures while it is read."""

    networks: Networks
    normals: list[TextureInput | Node] = field(default_factory=list)
    active: list[Sdf.Path] = field(default_factory=list)

    def input(self, shader: UsdShade.Shader, name: str, default: Any, kind: Kind) -> Input:
        return self.networks.read(shader, name, default, kind)

    def closure(self, shader: UsdShade.Shader, name: str) -> Closure | None:
        """The closure connected to an input; None if there is none."""
        source = self.networks.source(shader, name)
        if source is None or source.shader is None:
            return None
        path = source.shader.GetPath()
        reader = CLOSURES.get(source.node)
        if reader is None:
            raise Unusable(
                f"MaterialX closures of type {source.node or '(none)'} are not rendered", path
            )
        with entered(self.active, path):
            closure = reader(self, source.shader)
        # A lobe whose weight is the constant 0 is not there.
        return None if is_zero(getattr(closure, "weight", 1.0)) else closure

    def scatter(self, shader: UsdShade.Shader, name: str) -> Closure:
        """As :meth:`closure`; an unconnected closure is black, as MaterialX has it."""
        return self.closure(shader, name) or Diffuse(color=BLACK, weight=0.0)


def _roughness(graph: Graph, shader: UsdShade.Shader) -> Any:
    """GGX alpha, isotropic as one input where both are equal."""
    value = graph.input(shader, "roughness", (0.05, 0.05), "float2")
    if isinstance(value, TextureInput) and value.channel == "rgb":
        return replace(value, channel="r"), replace(value, channel="g")
    if isinstance(value, Node) and value.width == 2:
        x, y = value.inputs if value.operation == "combine2" else (lane(value, 0), lane(value, 1))
        return x if x is y else (x, y)
    if isinstance(value, tuple) and len(value) == 2 and value[0] == value[1]:
        return value[0]
    return value


def _scatter_mode(graph: Graph, shader: UsdShade.Shader) -> str:
    mode = str(graph.networks.value(shader, "scatter_mode", "R"))
    if mode not in ("R", "T", "RT"):
        graph.networks.report.warn(f"scatter mode {mode!r} is read as R", shader.GetPath())
        return "R"
    return mode


def _note_shared(graph: Graph, shader: UsdShade.Shader) -> None:
    """Inputs that several BSDFs have: a normal map; thin films are left out."""
    normal = read_normal(graph.networks, shader, "normal")
    if normal is not None:
        graph.normals.append(normal)
    thickness = graph.input(shader, "thinfilm_thickness", 0.0, "float")
    if thickness != 0.0:
        graph.networks.report.warn("thin films are not rendered", shader.GetPath())


# ---------------------------------------------------------------------------------------------
# BSDFs


def _diffuse(graph: Graph, shader: UsdShade.Shader) -> Closure:
    _note_shared(graph, shader)
    return Diffuse(
        color=graph.input(shader, "color", (0.18, 0.18, 0.18), "color"),
        weight=graph.input(shader, "weight", 1.0, "float"),
        roughness=graph.input(shader, "roughness", 0.0, "float"),
        energy_compensation=bool(graph.networks.value(shader, "energy_compensation", False)),
    )


def _burley(graph: Graph, shader: UsdShade.Shader) -> Closure:
    graph.networks.report.note(
        "Burley's diffuse reflection is rendered as Oren and Nayar's", shader.GetPath()
    )
    return _diffuse(graph, shader)


def _subsurface(graph: Graph, shader: UsdShade.Shader) -> Closure:
    _note_shared(graph, shader)
    graph.networks.report.note(
        "subsurface scattering is rendered as diffuse reflection", shader.GetPath()
    )
    return Diffuse(
        color=graph.input(shader, "color", (0.18, 0.18, 0.18), "color"),
        weight=graph.input(shader, "weight", 1.0, "float"),
    )


def _sheen(graph: Graph, shader: UsdShade.Shader) -> Closure:
    _note_shared(graph, shader)
    return Sheen(
        color=graph.input(shader, "color", WHITE, "color"),
        weight=graph.input(shader, "weight", 1.0, "float"),
        roughness=graph.input(shader, "roughness", 0.3, "float"),
    )


def _translucent(graph: Graph, shader: UsdShade.Shader) -> Closure:
    _note_shared(graph, shader)
    return Translucent(
        color=graph.input(shader, "color", WHITE, "color"),
        weight=graph.input(shader, "weight", 1.0, "float"),
    )


def _dielectric(graph: Graph, shader: UsdShade.Shader) -> Closure:
    _note_shared(graph, shader)
    return Dielectric(
        ior=graph.input(shader, "ior", 1.5, "float"),
        roughness=_roughness(graph, shader),
        tint=graph.input(shader, "tint", WHITE, "color"),
        weight=graph.input(shader, "weight", 1.0, "float"),
        scatter_mode=_scatter_mode(graph, shader),
    )


def _conductor(graph: Graph, shader: UsdShade.Shader) -> Closure:
    _note_shared(graph, shader)
    default = Conductor()
    return Conductor(
        ior=graph.input(shader, "ior", default.ior, "data"),
        extinction=graph.input(shader, "extinction", default.extinction, "data"),
        roughness=_roughness(graph, shader),
        weight=graph.input(shader, "weight", 1.0, "float"),
    )


def _generalized_schlick(graph: Graph, shader: UsdShade.Shader) -> Closure:
    _note_shared(graph, shader)
    return GeneralizedSchlick(
        color0=graph.input(shader, "color0", WHITE, "color"),
        color82=graph.input(shader, "color82", WHITE, "color"),
        color90=graph.input(shader, "color90", WHITE, "color"),
        exponent=graph.input(shader, "exponent", 5.0, "float"),
        roughness=_roughness(graph, shader),
        weight=graph.input(shader, "weight", 1.0, "float"),
        scatter_mode=_scatter_mode(graph, shader),
    )


def _uniform_edf(graph: Graph, shader: UsdShade.Shader) -> Closure:
    return UniformEmission(color=graph.input(shader, "color", WHITE, "color"))


# ---------------------------------------------------------------------------------------------
# Combinations


def _layer(graph: Graph, shader: UsdShade.Shader) -> Closure:
    top, base = graph.closure(shader, "top"), graph.closure(shader, "base")
    if top is None or base is None:
        return top or base or graph.scatter(shader, "base")
    return Layer(top=top, base=base)


def _mix(graph: Graph, shader: UsdShade.Shader) -> Closure:
    share = graph.input(shader, "mix", 0.0, "float")
    if is_constant(share) and share in (0.0, 1.0):
        return graph.scatter(shader, "fg" if share else "bg")
    return Mix(graph.scatter(shader, "fg"), graph.scatter(shader, "bg"), share)


def _layer_volume(graph: Graph, shader: UsdShade.Shader) -> Closure:
    """A BSDF over a volume, which ``materialx_volumes`` reads."""
    return graph.scatter(shader, "top")


def _schlick_edf(graph: Graph, shader: UsdShade.Shader) -> Closure:
    """Emission that falls off towards grazing angles, taken as it is at normal incidence: here all
    directions emit the same."""
    return Multiply(graph.scatter(shader, "base"), graph.input(shader, "color0", WHITE, "color"))


def _add(graph: Graph, shader: UsdShade.Shader) -> Closure:
    return Add(a=graph.scatter(shader, "in1"), b=graph.scatter(shader, "in2"))


def _multiply_by_float(graph: Graph, shader: UsdShade.Shader) -> Closure:
    return Multiply(graph.scatter(shader, "in1"), graph.input(shader, "in2", 1.0, "float"))


def _multiply_by_color(graph: Graph, shader: UsdShade.Shader) -> Closure:
    return Multiply(graph.scatter(shader, "in1"), graph.input(shader, "in2", WHITE, "color"))


CLOSURES: dict[str, Callable[[Graph, UsdShade.Shader], Closure]] = {
    "ND_oren_nayar_diffuse_bsdf": _diffuse,
    "ND_burley_diffuse_bsdf": _burley,
    "ND_subsurface_bsdf": _subsurface,
    "ND_sheen_bsdf": _sheen,
    "ND_translucent_bsdf": _translucent,
    "ND_dielectric_bsdf": _dielectric,
    "ND_conductor_bsdf": _conductor,
    "ND_generalized_schlick_bsdf": _generalized_schlick,
    "ND_uniform_edf": _uniform_edf,
    "ND_generalized_schlick_edf": _schlick_edf,
    "ND_layer_bsdf": _layer,
    "ND_layer_vdf": _layer_volume,
    "ND_mix_bsdf": _mix,
    "ND_mix_edf": _mix,
    "ND_add_bsdf": _add,
    "ND_add_edf": _add,
    "ND_multiply_bsdfF": _multiply_by_float,
    "ND_multiply_bsdfC": _multiply_by_color,
    "ND_multiply_edfF": _multiply_by_float,
    "ND_multiply_edfC": _multiply_by_color,
}


# ---------------------------------------------------------------------------------------------
# Surfaces


def read_unlit(networks: Networks, shader: UsdShade.Shader) -> Material:
    """ND_surface_unlit: only emission; what it transmits is not there."""
    strength = networks.read(shader, "emission", 1.0, "float")
    color = networks.read(shader, "emission_color", WHITE, "color")
    through = networks.read(shader, "transmission", 0.0, "float")
    if not is_zero(through):
        networks.report.note(
            "the transmission of unlit surfaces is part of their opacity", shader.GetPath()
        )
    opacity = networks.read(shader, "opacity", 1.0, "float")
    return Material(
        UniformEmission(multiply(color, strength)),
        opacity=multiply(opacity, subtract(1.0, through)),
    )


def read_surface(networks: Networks, shader: UsdShade.Shader) -> Material:
    """ND_surface: a BSDF, an EDF and an opacity, which is a coverage.

    Raises :class:`Unusable` where the graph has closures that are not rendered.
    """
    graph = Graph(networks)
    bsdf, emission = graph.closure(shader, "bsdf"), graph.closure(shader, "edf")
    closure = Add(bsdf, emission) if bsdf and emission else bsdf or emission
    if any(str(normal) != str(graph.normals[0]) for normal in graph.normals[1:]):
        networks.report.warn(
            "closures of one surface share the first one's normal map", shader.GetPath()
        )
    return Material(
        closure,
        opacity=networks.read(shader, "opacity", 1.0, "float"),
        normal=graph.normals[0] if graph.normals else None,
        thin_walled=_is_thin_walled(networks, shader, closure),
    )


def _is_thin_walled(networks: Networks, shader: UsdShade.Shader, closure: Closure | None) -> bool:
    """As authored; but closures that refract bound a solid."""
    if not networks.value(shader, "thin_walled", False):
        return False
    if _refracts(closure):
        networks.report.warn("thin walls that refract are rendered as solids", shader.GetPath())
        return False
    return True


def _refracts(closure: object) -> bool:
    if isinstance(closure, (Dielectric, GeneralizedSchlick)):
        return "T" in closure.scatter_mode and getattr(closure, "ior", None) != 1.0
    parts = (Layer, Mix, Add, Multiply)
    return isinstance(closure, parts) and any(map(_refracts, vars(closure).values()))
