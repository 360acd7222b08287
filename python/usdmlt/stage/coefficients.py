"""Coefficients of media as shaders have them: constants, finite, at least 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import UsdShade

from usdmlt.scene import Color, Input, Node, PrimvarInput
from usdmlt.stage.expressions import KNOWN, is_constant, operate, plain
from usdmlt.stage.networks import Kind, Networks

MOST_ANISOTROPIC = 0.999  # beyond, a phase function is all but one direction


@dataclass
class Coefficients:
    """Reads them. ``density``: the primvar that holds the density of a field; coefficients are
    those of density 1, as the field multiplies them."""

    networks: Networks
    density: str = ""

    def number(self, shader: UsdShade.Shader, name: str, default: float) -> float:
        return float(self._constant(shader, name, default, "float"))

    def color(
        self, shader: UsdShade.Shader, name: str, default: Color, kind: Kind = "color"
    ) -> Color:
        """Three numbers of at least 0; what is below counts as 0, with a warning."""
        value = self._constant(shader, name, default, kind)
        numbers = np.broadcast_to(np.atleast_1d(np.asarray(value, dtype=np.float64))[:3], 3)
        if numbers.min() < 0:
            self.networks.report.warn("coefficients of media below 0 count as 0", shader.GetPath())
        return _color(np.maximum(numbers, 0.0))

    def anisotropy(self, shader: UsdShade.Shader, name: str) -> float:
        """A mean cosine between -1 and 1; what is not counts as the nearest, with a warning."""
        value = self.number(shader, name, 0.0)
        if not abs(value) <= MOST_ANISOTROPIC:
            self.networks.report.warn(
                f"anisotropies of media beyond {MOST_ANISOTROPIC} count as that", shader.GetPath()
            )
        return float(np.clip(value, -MOST_ANISOTROPIC, MOST_ANISOTROPIC))

    def _constant(self, shader: UsdShade.Shader, name: str, default: Any, kind: Kind) -> Any:
        value = self._of_density_one(self.networks.read(shader, name, default, kind))
        if is_constant(value):
            return value
        self.networks.report.warn(
            f"coefficients of media that vary count as {name} = {default}", shader.GetPath()
        )
        return default

    def _of_density_one(self, value: Input) -> Input:
        """A value where the primvar of the density is 1."""
        if isinstance(value, PrimvarInput) and self.density and value.primvar == self.density:
            return 1.0
        if isinstance(value, Node) and value.operation in KNOWN:
            return operate(value.operation, *map(self._of_density_one, value.inputs))
        return value


def of_depth(color: Color, depth: float, scatter: Color) -> tuple[Color, Color]:
    """Scattering and absorption of an interior whose light has a colour after a depth.

    OpenPBR Surface 1.1, "Translucent base": μ_t = -ln T / λ, μ_s = S / λ, μ_a = μ_t - μ_s, and
    where a component of that is negative, grey is added until none is. Standard Surface has the
    same inputs; its text leaves open that S is in units of 1 / λ, but MaterialX translates one into
    the other unchanged.
    """
    seen = np.maximum(np.asarray(color, dtype=np.float64), LEAST_TRANSMITTED)
    scattering = np.asarray(scatter, dtype=np.float64) / depth
    absorption = -np.log(seen) / depth - scattering
    return _color(scattering), _color(absorption - min(absorption.min(), 0.0))


LEAST_TRANSMITTED = 1e-6  # of a channel of a transmission colour: black would have no logarithm


def _color(numbers: np.ndarray) -> Color:
    red, green, blue = plain(numbers)
    return red, green, blue
