"""What standard_surface and OpenPBR share: how lobes are mixed and layered, and what is left out.

Both are read as trees of the closures that MaterialX's own graphs build of them (libraries/bxdf);
parts whose weight is the constant 0 are left out. Approximations, each with one warning where it
matters: subsurface scattering is diffuse reflection of its colour (what it converges to for a short
mean free path), and dispersion, thin films and normals of the coat alone are left out. What fills
them is read by ``interiors``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pxr import UsdShade

from usdmlt.scene import (
    Add,
    Closure,
    Dielectric,
    Diffuse,
    Input,
    Layer,
    Material,
    Mix,
    Multiply,
    Node,
    TextureInput,
    UniformEmission,
)
from usdmlt.stage.expressions import is_constant, multiply, operate, plain
from usdmlt.stage.materialx_normals import read_normal
from usdmlt.stage.networks import Networks, is_zero

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


@dataclass
class Inputs:
    """The inputs of a surface node, by name."""

    networks: Networks
    shader: UsdShade.Shader
    defaults: dict[str, Any]

    def __getitem__(self, name: str) -> Input:
        """A number or a colour, by what its default is."""
        default = self.defaults[name]
        kind = "color" if isinstance(default, tuple) else "float"
        return self.networks.read(self.shader, name, default, kind)

    def flag(self, name: str) -> bool:
        return bool(self.networks.value(self.shader, name, self.defaults[name]))

    def warn(self, what: str) -> None:
        self.networks.report.warn(what, self.shader.GetPath())

    def leave_out(self, what: str, name: str, unless: Any = 0.0) -> None:
        """Warn if an input that is not followed has other than its neutral value."""
        value = self[name]
        if not is_constant(value) or plain(value) != unless:
            self.warn(f"{what} not rendered")

    def normal(self, name: str, coat: str) -> TextureInput | Node | None:
        """The normal map; that of the coat has to be the same."""
        normal = read_normal(self.networks, self.shader, name)
        coat_source = self.networks.source(self.shader, coat)
        source = self.networks.source(self.shader, name)
        if coat_source is not None and coat_source.shader is not None:
            own = source.shader.GetPath() if source and source.shader else None
            if coat_source.shader.GetPath() != own:
                self.warn("normals of coats alone are not rendered")
        return normal


def is_one(value: Input) -> bool:
    return is_constant(value) and plain(value) == 1.0


def blend(foreground: Closure | None, background: Closure | None, share: Input) -> Closure:
    """A mix, or the only part of it that is there."""
    if is_zero(share) or foreground is None:
        return background if background is not None else Diffuse(BLACK, 0.0)
    if is_one(share):
        return foreground
    return Mix(foreground, background or Diffuse(BLACK, 0.0), share)


def layer(top: Closure, weight: Input, base: Closure) -> Closure:
    """A layer, unless its weight is 0."""
    return base if is_zero(weight) else Layer(top, base)


def tinted(closure: Closure, factor: Input) -> Closure:
    """A closure scaled by a colour, unless that is white."""
    if is_constant(factor) and plain(factor) in (1.0, WHITE):
        return closure
    return Multiply(closure, factor)


def tint(inputs: Inputs) -> Input:
    """The colour of what is transmitted, at the surface: none where it is that of a depth, which is
    reached inside."""
    depth = inputs["transmission_depth"]
    inside = is_constant(depth) and plain(depth) > 0
    return WHITE if inside else inputs["transmission_color"]


def clear(
    ior: Input, roughness: Any, reflection: Input, transmission: Input, thin_walled: bool
) -> Closure:
    """A transparent base: an interface to a medium of ``ior``, or a thin wall.

    A thin wall passes straight on what it does not reflect; its second face is not followed.
    """
    if not thin_walled:
        return Dielectric(
            ior,
            roughness,
            scatter_mode="RT",
            reflection_tint=reflection,
            transmission_tint=transmission,
        )
    return Layer(
        Dielectric(ior, roughness, tint=reflection),
        Dielectric(1.0, 0.0, tint=transmission, scatter_mode="T"),
    )


def emitting(closure: Closure, emission: Input) -> Closure:
    return closure if is_zero(emission) else Add(closure, UniformEmission(emission))


def coated_emission(emission: Input, coat: Input, color: Input, ior: Input) -> Input:
    """Emission through a coat: tinted, and less what the coat reflects at normal incidence.

    MaterialX's graphs let the coat's share grow with the angle; here emission is the same in all
    directions.
    """
    if is_zero(emission) or is_zero(coat):
        return emission
    root = operate("divide", operate("subtract", ior, 1.0), operate("add", ior, 1.0))
    passed = operate("subtract", 1.0, operate("multiply", root, root))
    return operate("mix", multiply(multiply(emission, color), passed), emission, coat)


def surface(
    closure: Closure,
    opacity: Input,
    normal: TextureInput | Node | None,
    rotation: Input,
    thin_walled: bool,
) -> Material:
    return Material(
        closure,
        opacity=opacity,
        normal=normal,
        tangent_rotation=rotation,
        thin_walled=thin_walled,
    )


def warn_of_approximations(inputs: Inputs, weight: str, names: Sequence[tuple[str, str, Any]]):
    """Warn of what is left out of a part of the surface, if the part is there at all."""
    if not is_zero(inputs[weight]):
        for what, name, neutral in names:
            inputs.leave_out(what, name, neutral)
