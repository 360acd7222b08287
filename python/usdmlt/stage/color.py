"""Colours into the rendering colour space.

Untagged colours are linear Rec.709 (USD's default). Named spaces are those of ``Gf.ColorSpace``,
whose names are also OpenImageIO's and the Color Interop Forum's; common names of other
applications are accepted as aliases.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from pxr import Gf, Usd

from usdmlt.errors import Report, UsageError
from usdmlt.scene import Color

DEFAULT = "lin_rec709_scene"
DATA = {"", "raw", "data", "unknown", "identity", "none"}

ALIASES = {
    "lin_rec709": "lin_rec709_scene",
    "lin_srgb": "lin_rec709_scene",
    "linear": "lin_rec709_scene",
    "scene_linear": "lin_rec709_scene",
    "srgb": "srgb_rec709_scene",
    "srgb_texture": "srgb_rec709_scene",
    "srgb_rec709_display": "srgb_rec709_scene",
    "g18_rec709": "g18_rec709_scene",
    "g22_rec709": "g22_rec709_scene",
    "g24_rec709": "g24_rec709_scene",
    "rec709_display": "g24_rec709_scene",
    "acescg": "lin_ap1_scene",
    "lin_ap1": "lin_ap1_scene",
    "srgb_ap1": "srgb_ap1_scene",
    "g22_ap1": "g22_ap1_scene",
    "aces2065-1": "lin_ap0_scene",
    "lin_ap0": "lin_ap0_scene",
    "lin_rec2020": "lin_rec2020_scene",
    "lin_p3d65": "lin_p3d65_scene",
    "lin_displayp3": "lin_p3d65_scene",
    "srgb_displayp3": "srgb_p3d65_scene",
    "srgb_p3d65": "srgb_p3d65_scene",
    "adobergb": "g22_adobergb_scene",
    "g22_adobergb": "g22_adobergb_scene",
    "lin_adobergb": "lin_adobergb_scene",
}


def canonical(name: str) -> str | None:
    """The ``Gf.ColorSpace`` name of a colour space, "raw" for data, None if it is unknown."""
    lower = name.lower()
    if lower in DATA:
        return "raw"
    lower = ALIASES.get(lower, lower)
    return lower if Gf.ColorSpace.IsValid(lower) else None


@cache
def conversion_matrix(source: str, target: str) -> np.ndarray:
    """(3, 3) float64 M with ``target_rgb = M @ source_rgb`` for linear values.

    White goes to white: Gf.ColorSpace keeps the primaries of spaces with another white adapted to
    D65 (Bradford).
    """
    from_xyz = np.array(Gf.ColorSpace(source).GetRGBToXYZ(), dtype=np.float64)
    to_xyz = np.array(Gf.ColorSpace(target).GetRGBToXYZ(), dtype=np.float64)
    matrix = np.linalg.solve(to_xyz, from_xyz)
    return np.eye(3) if np.allclose(matrix, np.eye(3), atol=1e-6) else matrix


def decode(values: np.ndarray, space: str) -> np.ndarray:
    """Undo the transfer curve of a named space (sRGB: IEC 61966-2-1; others: a power)."""
    if space.startswith("srgb"):
        low, high = values / 12.92, ((np.maximum(values, 0.0) + 0.055) / 1.055) ** 2.4
        return np.where(values <= 0.04045, low, high)
    gamma = Gf.ColorSpace(space).GetGamma()
    if gamma == 1.0:
        return values
    return np.sign(values) * np.abs(values) ** gamma


class ColorSpaces:
    """Converts authored colours into one linear rendering colour space."""

    def __init__(self, rendering: str = DEFAULT, report: Report | None = None):
        name = canonical(rendering)
        if name in (None, "raw") or not name.startswith("lin_") or "xyz" in name:
            raise UsageError(f"not a linear RGB colour space: {rendering!r}")
        self.rendering = name
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
        return self.named(name, attribute.GetPath()) if name else DEFAULT

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
