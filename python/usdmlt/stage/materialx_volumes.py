"""MaterialX volumes: VDF nodes, alone (ND_volume) or below a BSDF (ND_layer_vdf), as media.

Input names and defaults are those of MaterialX's pbrlib definitions. Coefficients are per scene
unit. A mix, a sum and a product of VDFs are those of their coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from pxr import Sdf, UsdShade

from usdmlt.scene import Add, Closure, Color, Medium, Mix, Multiply, UniformEmission
from usdmlt.stage.coefficients import Coefficients
from usdmlt.stage.expressions import add, is_constant, mix, multiply
from usdmlt.stage.materialx import Graph
from usdmlt.stage.networks import Networks, Unusable, entered

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
LAYER = "ND_layer_vdf"
# The closures below a surface and its combinations of BSDFs.
OPERANDS = ("bsdf", "top", "base", "fg", "bg", "in1", "in2")


@dataclass
class Volumes:
    """A graph of VDFs while it is read."""

    networks: Networks
    coefficients: Coefficients
    active: list[Sdf.Path] = field(default_factory=list)

    def vdf(self, shader: UsdShade.Shader, name: str) -> Medium:
        """The medium that is connected to an input; a clear one if there is none."""
        source = self.networks.source(shader, name)
        if source is None or source.shader is None:
            return Medium()
        path = source.shader.GetPath()
        reader = VDFS.get(source.node)
        if reader is None:
            raise Unusable(
                f"MaterialX volumes of type {source.node or '(none)'} are not rendered", path
            )
        with entered(self.active, path):
            return reader(self, source.shader)


def _absorption(graph: Volumes, shader: UsdShade.Shader) -> Medium:
    return Medium(absorption=graph.coefficients.color(shader, "absorption", BLACK, "value"))


def _anisotropic(graph: Volumes, shader: UsdShade.Shader) -> Medium:
    return Medium(
        absorption=graph.coefficients.color(shader, "absorption", BLACK, "value"),
        scattering=graph.coefficients.color(shader, "scattering", BLACK, "value"),
        anisotropy=graph.coefficients.anisotropy(shader, "anisotropy"),
    )


def _add(graph: Volumes, shader: UsdShade.Shader) -> Medium:
    return _sum(graph, shader, graph.vdf(shader, "in1"), graph.vdf(shader, "in2"))


def _mix(graph: Volumes, shader: UsdShade.Shader) -> Medium:
    share = float(np.clip(graph.coefficients.number(shader, "mix", 0.0), 0.0, 1.0))
    foreground = _scaled(graph.vdf(shader, "fg"), share)
    return _sum(graph, shader, foreground, _scaled(graph.vdf(shader, "bg"), 1.0 - share))


def _multiply_by_float(graph: Volumes, shader: UsdShade.Shader) -> Medium:
    factor = graph.coefficients.number(shader, "in2", 1.0)
    if factor < 0:
        graph.networks.report.warn("coefficients of media below 0 count as 0", shader.GetPath())
    return _scaled(graph.vdf(shader, "in1"), max(factor, 0.0))


def _multiply_by_color(graph: Volumes, shader: UsdShade.Shader) -> Medium:
    return _scaled(graph.vdf(shader, "in1"), graph.coefficients.color(shader, "in2", WHITE))


VDFS: dict[str, Callable[[Volumes, UsdShade.Shader], Medium]] = {
    "ND_absorption_vdf": _absorption,
    "ND_anisotropic_vdf": _anisotropic,
    "ND_add_vdf": _add,
    "ND_mix_vdf": _mix,
    "ND_multiply_vdfF": _multiply_by_float,
    "ND_multiply_vdfC": _multiply_by_color,
}


def read_volume(networks: Networks, shader: UsdShade.Shader, density: str = "") -> Medium:
    """ND_volume: a VDF, and an EDF that is the radiance emitted per scene unit.

    Raises :class:`Unusable` where the graph has closures that are not rendered.
    """
    graph = Volumes(networks, Coefficients(networks, density))
    medium = graph.vdf(shader, "vdf")
    emission = _emission(Graph(networks).closure(shader, "edf"))
    if not is_constant(emission):
        networks.report.warn("emission of media that varies is left out", shader.GetPath())
        emission = BLACK
    medium.emission = _color(np.maximum(np.broadcast_to(emission, 3), 0.0))
    return medium


def read_layered_volume(networks: Networks, shader: UsdShade.Shader) -> Medium | None:
    """The medium below the BSDFs of an ND_surface that has been read; None if there is none."""
    layers = list(dict.fromkeys(_layers(networks, shader)))
    if not layers:
        return None
    if len(layers) > 1:
        networks.report.warn("of several volumes in one surface the first counts", layers[0])
    layer = UsdShade.Shader(shader.GetPrim().GetStage().GetPrimAtPath(layers[0]))
    return Volumes(networks, Coefficients(networks)).vdf(layer, "base")


def _layers(networks: Networks, shader: UsdShade.Shader) -> Iterator[Sdf.Path]:
    """The paths of the ND_layer_vdf nodes below a shader."""
    for name in OPERANDS:
        source = networks.source(shader, name)
        if source is not None and source.shader is not None:
            if source.node == LAYER:
                yield source.shader.GetPath()
            yield from _layers(networks, source.shader)


def _emission(edf: Closure | None):
    """The radiance of a tree of EDFs: an input."""
    match edf:
        case UniformEmission():
            return edf.color
        case Multiply():
            return multiply(_emission(edf.closure), edf.factor)
        case Add():
            return add(_emission(edf.a), _emission(edf.b))
        case Mix():
            return mix(_emission(edf.foreground), _emission(edf.background), edf.mix)
    return BLACK


def _scaled(medium: Medium, factor: float | Color) -> Medium:
    return Medium(
        scattering=_color(np.multiply(medium.scattering, factor)),
        absorption=_color(np.multiply(medium.absorption, factor)),
        anisotropy=medium.anisotropy,
    )


def _sum(graph: Volumes, shader: UsdShade.Shader, a: Medium, b: Medium) -> Medium:
    """Coefficients add. A sum of phase functions is the one of their mean cosine, weighted by what
    scatters; a warning says so where they differ."""
    weights = np.array([np.mean(a.scattering), np.mean(b.scattering)])
    cosines = np.array([a.anisotropy, b.anisotropy])
    if (weights > 0).all() and cosines[0] != cosines[1]:
        graph.networks.report.warn(
            "mixed phase functions are rendered as the one of their mean cosine", shader.GetPath()
        )
    total = weights.sum()
    return Medium(
        scattering=_color(np.add(a.scattering, b.scattering)),
        absorption=_color(np.add(a.absorption, b.absorption)),
        anisotropy=float(weights @ cosines / total) if total > 0 else 0.0,
    )


def _color(numbers: np.ndarray) -> Color:
    red, green, blue = map(float, numbers)
    return red, green, blue
