"""What surfaces that refract are filled with, by the node of the surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pxr import UsdShade

from usdmlt.scene import Medium
from usdmlt.stage.coefficients import Coefficients, of_depth
from usdmlt.stage.materialx_volumes import read_layered_volume
from usdmlt.stage.networks import Networks

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


def _of_transmission(weight: str) -> Callable[[Networks, UsdShade.Shader], Medium | None]:
    """standard_surface and OpenPBR: the inputs transmission_color, _depth, _scatter and
    _scatter_anisotropy, where anything is transmitted at all."""

    def read(networks: Networks, shader: UsdShade.Shader) -> Medium | None:
        transmitted: Any = networks.read(shader, weight, 0.0, "float")
        coefficients = Coefficients(networks)
        depth = coefficients.number(shader, "transmission_depth", 0.0)
        if transmitted == 0.0 or not depth > 0:
            return None
        scattering, absorption = of_depth(
            coefficients.color(shader, "transmission_color", WHITE),
            depth,
            coefficients.color(shader, "transmission_scatter", BLACK),
        )
        anisotropy = coefficients.anisotropy(shader, "transmission_scatter_anisotropy")
        return Medium(scattering, absorption, anisotropy=anisotropy)

    return read


INTERIORS: dict[str, Callable[[Networks, UsdShade.Shader], Medium | None]] = {
    "ND_surface": read_layered_volume,
    "ND_standard_surface_surfaceshader": _of_transmission("transmission"),
    "ND_standard_surface_surfaceshader_100": _of_transmission("transmission"),
    "ND_open_pbr_surface_surfaceshader": _of_transmission("transmission_weight"),
}
