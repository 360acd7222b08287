"""Rendering colour spaces and the view for looking at pictures.

All colours right of the stage reader are linear in one RGB space, named by its OpenUSD /
Color Interop Forum token. The default is linear Rec.709 with the D65 white.
"""

from __future__ import annotations

import importlib
import warnings
from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from usdmlt.errors import UsageError

DEFAULT = "lin_rec709_scene"

FloatArray = npt.NDArray[np.float32]


class Chromaticities(NamedTuple):
    """CIE 1931 (x, y) of the primaries and of the white, in the order of the EXR attribute."""

    red: tuple[float, float]
    green: tuple[float, float]
    blue: tuple[float, float]
    white: tuple[float, float]

    def flat(self) -> tuple[float, ...]:
        """The eight numbers in a row."""
        return (*self.red, *self.green, *self.blue, *self.white)


class RenderingSpace(NamedTuple):
    """A linear RGB space: its chromaticities and what colour-science calls it."""

    chromaticities: Chromaticities
    colour_name: str


_D65 = (0.3127, 0.3290)
_ACES_WHITE = (0.32168, 0.33767)

RENDERING_SPACES: dict[str, RenderingSpace] = {
    "lin_rec709_scene": RenderingSpace(
        Chromaticities((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), _D65), "ITU-R BT.709"
    ),
    "lin_rec2020_scene": RenderingSpace(
        Chromaticities((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), _D65), "ITU-R BT.2020"
    ),
    "lin_p3d65_scene": RenderingSpace(
        Chromaticities((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), _D65), "P3-D65"
    ),
    "lin_adobergb_scene": RenderingSpace(
        Chromaticities((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), _D65), "Adobe RGB (1998)"
    ),
    "lin_ap1_scene": RenderingSpace(
        Chromaticities((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), _ACES_WHITE), "ACEScg"
    ),
    "lin_ap0_scene": RenderingSpace(
        Chromaticities((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770), _ACES_WHITE),
        "ACES2065-1",
    ),
}


def rendering_space(name: str) -> RenderingSpace:
    """The space of that name; ValueError with the known names otherwise."""
    try:
        return RENDERING_SPACES[name]
    except KeyError:
        known = ", ".join(RENDERING_SPACES)
        raise UsageError(f"unknown colour space {name!r}; known are {known}") from None


def conversion(source: str, target: str) -> npt.NDArray[np.float64]:
    """The 3x3 matrix M that takes linear RGB from one space to another: ``M @ rgb``.

    White goes to white: Bradford adaptation where the white points differ, as in ACES.
    """
    source_space, target_space = rendering_space(source), rendering_space(target)
    if source == target:
        return np.eye(3)
    colour = _colour_science()
    matrix = colour.matrix_RGB_to_RGB(
        colour.RGB_COLOURSPACES[source_space.colour_name],
        colour.RGB_COLOURSPACES[target_space.colour_name],
        chromatic_adaptation_transform="Bradford",
    )
    return np.asarray(matrix, dtype=np.float64)


def srgb_view(color: FloatArray, color_space: str = DEFAULT) -> npt.NDArray[np.uint8]:
    """The picture as sRGB displays show it: (..., 3) linear in ``color_space`` to 8-bit sRGB.

    The plain view: no exposure, no tone curve; what is outside the gamut or brighter than white
    is clipped. Transfer function of IEC 61966-2-1.
    """
    linear = np.asarray(color, dtype=np.float32)
    if color_space != DEFAULT:
        linear = linear @ conversion(color_space, DEFAULT).T.astype(np.float32)
    linear = np.clip(linear, 0.0, 1.0)
    encoded = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055
    )
    return np.asarray(np.rint(encoded * 255.0), dtype=np.uint8)


def _colour_science() -> ModuleType:
    """Import colour-science, which takes a second and complains about what it could plot with."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module("colour")
