"""Colours into the rendering colour space.

Untagged colours are linear Rec.709 (USD's default). Named spaces are those of ``Gf.ColorSpace``,
whose names are also OpenImageIO's and the Color Interop Forum's; common names of other
applications are accepted as aliases.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from pxr import Gf, Usd

from usdmlt.color import (
    ALIASES,
    DEFAULT,
    Chromaticities,
    matrix_to_xyz,
    rendering_space,
    rendering_space_name,
)
from usdmlt.errors import Report
from usdmlt.scene import Color

DATA = {"", "raw", "data", "unknown", "identity", "none"}
DEFINED = (
    "defined"  # a space by a stage's own definition: "defined xR yR xG yG xB yB xW yW gamma bias"
)


def canonical(name: str) -> str | None:
    """The ``Gf.ColorSpace`` name of a colour space, "raw" for data, None if it is unknown."""
    lower = name.lower()
    if lower in DATA:
        return "raw"
    lower = ALIASES.get(lower, lower)
    return lower if Gf.ColorSpace.IsValid(lower) else None


def defined(space: Gf.ColorSpace) -> str:
    """A space that a stage defines (UsdColorSpaceDefinitionAPI), as one string."""
    chromaticities = [v for xy in space.GetPrimariesAndWhitePoint() for v in xy]
    numbers = (*chromaticities, space.GetGamma(), space.GetLinearBias())
    return " ".join([DEFINED, *(f"{number:.9g}" for number in numbers)])


@cache
def conversion_matrix(source: str, target: str) -> np.ndarray:
    """(3, 3) float64 M with ``target_rgb = M @ source_rgb`` for linear values; white to white."""
    matrix = np.linalg.solve(_to_xyz(target), _to_xyz(source))
    return np.eye(3) if np.allclose(matrix, np.eye(3), atol=1e-6) else matrix


def _to_xyz(space: str) -> np.ndarray:
    """From linear values of a space to XYZ with D65 as white."""
    if space.startswith(DEFINED):
        x = [float(number) for number in space.split()[1:9]]
        return matrix_to_xyz(Chromaticities(*((x[i], x[i + 1]) for i in range(0, 8, 2))))
    primaries = space.split("_")[1]  # as in srgb_p3d65_scene
    if primaries.startswith("ciexyz"):
        return np.eye(3)
    return np.array(rendering_space(f"lin_{primaries}_scene").to_xyz)


def decode(values: np.ndarray, space: str) -> np.ndarray:
    """Undo the transfer curve of a space (sRGB: IEC 61966-2-1; others: a power, with a line below
    it where a stage defines one)."""
    if space.startswith("srgb"):
        low, high = values / 12.92, ((np.maximum(values, 0.0) + 0.055) / 1.055) ** 2.4
        return np.where(values <= 0.04045, low, high)
    gamma, bias = transfer(space)
    if gamma == 1.0:
        return values
    if bias == 0.0:
        return np.sign(values) * np.abs(values) ** gamma
    # The line through 0 is tangent to the curve ((v + b) / (1 + b))^g: they meet at b / (g - 1).
    knee = bias / (gamma - 1.0)
    slope = ((knee + bias) / (1.0 + bias)) ** gamma / knee
    curve = (np.maximum(values + bias, 0.0) / (1.0 + bias)) ** gamma
    return np.where(values <= knee, values * slope, curve)


def transfer(space: str) -> tuple[float, float]:
    """Gamma and linear bias of a space, (1, 0) of linear ones."""
    if space.startswith(DEFINED):
        gamma, bias = (float(number) for number in space.split()[9:])
        return gamma, bias
    found = Gf.ColorSpace(space)
    return found.GetGamma(), found.GetLinearBias()


class ColorSpaces:
    """Converts authored colours into one linear rendering colour space."""

    def __init__(self, rendering: str = DEFAULT, report: Report | None = None):
        self.rendering = rendering_space_name(rendering)
        self.report = report or Report()
        self._cache = Usd.ColorSpaceHashCache()

    def named(self, name: str, path: object) -> str:
        """The canonical name; an unknown space counts as linear Rec.709, with a warning."""
        space = canonical(name)
        if space is None:
            self.report.warn(f"unknown colour space {name!r}, read as {DEFAULT}", path)
            return DEFAULT
        return space

    def space_of(self, attribute: Usd.Attribute) -> str:
        """The colour space of an attribute's values: its own, its prim's, or linear Rec.709."""
        name = Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, self._cache)
        return self.declared(name, attribute) if name else DEFAULT

    def declared(self, name: str, attribute: Usd.Attribute) -> str:
        """The space that an attribute has by that name: known, or defined on an ancestor."""
        if canonical(name) is None and Usd.ColorSpaceAPI.IsValidColorSpaceName(
            attribute.GetPrim(), name, self._cache
        ):
            return defined(Usd.ColorSpaceAPI.ComputeColorSpace(attribute, self._cache))
        return self.named(name, attribute.GetPath())

    def same_primaries(self, space: str) -> bool:
        """Whether linear values of that space need no conversion."""
        return np.array_equal(conversion_matrix(space, self.rendering), np.eye(3))

    def change_primaries(self, values: np.ndarray, space: str) -> np.ndarray:
        """(..., 3) linear values with the primaries of a named space, in the rendering space."""
        if self.same_primaries(space):
            return values
        return values @ conversion_matrix(space, self.rendering).T.astype(values.dtype)

    def convert(self, values: np.ndarray, space: str) -> np.ndarray:
        """(..., 3) values of a named space, decoded and in the rendering space."""
        if space in ("raw", self.rendering):
            return values
        return self.change_primaries(decode(values, space), space)

    def color(self, value, attribute: Usd.Attribute) -> Color:
        """One authored colour in the rendering space."""
        rgb = self.convert(np.array(value[:3], dtype=np.float64), self.space_of(attribute))
        return (float(rgb[0]), float(rgb[1]), float(rgb[2]))
