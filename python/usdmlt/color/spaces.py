"""Linear RGB spaces, by their OpenUSD / Color Interop Forum names, and the matrices between them.

All colours right of the stage reader are linear in one of them, the rendering space. The default
is linear Rec.709 with the D65 white. White goes to white: primaries with another white, such as
those of ACES, are adapted to D65 (Bradford).
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
ADAPTATION = "Bradford"
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of Rec.709: a weighing of channels, no colour

Matrix = npt.NDArray[np.float64]


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
    """A linear RGB space: its chromaticities, and the matrix from RGB to XYZ with D65 as white."""

    chromaticities: Chromaticities
    to_xyz: tuple[tuple[float, float, float], ...]


D65 = (0.3127, 0.3290)
_ACES_WHITE = (0.32168, 0.33767)

# The matrices are matrix_to_xyz of the chromaticities, kept here because colour-science takes a
# second to import; the tests compute them again.
RENDERING_SPACES: dict[str, RenderingSpace] = {
    "lin_rec709_scene": RenderingSpace(
        Chromaticities((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), D65),
        (
            (0.4123907992659593, 0.35758433938387796, 0.18048078840183432),
            (0.21263900587151027, 0.7151686787677557, 0.07219231536073373),
            (0.019330818715591818, 0.11919477979462594, 0.9505321522496606),
        ),
    ),
    "lin_rec2020_scene": RenderingSpace(
        Chromaticities((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), D65),
        (
            (0.6369580483012912, 0.1446169035862085, 0.1688809751641721),
            (0.2627002120112669, 0.6779980715188711, 0.05930171646986198),
            (0.0, 0.02807269304908746, 1.0609850577107909),
        ),
    ),
    "lin_p3d65_scene": RenderingSpace(
        Chromaticities((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), D65),
        (
            (0.4865709486482159, 0.2656676931690932, 0.19821728523436247),
            (0.22897456406974867, 0.6917385218365064, 0.07928691409374498),
            (0.0, 0.04511338185890263, 1.0439443689009757),
        ),
    ),
    "lin_adobergb_scene": RenderingSpace(
        Chromaticities((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), D65),
        (
            (0.5766690429101304, 0.18555823790654627, 0.1882286462349947),
            (0.297344975250536, 0.6273635662554659, 0.07529145849399788),
            (0.027031361386412336, 0.07068885253582721, 0.9913375368376387),
        ),
    ),
    "lin_ap1_scene": RenderingSpace(
        Chromaticities((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), _ACES_WHITE),
        (
            (0.6522375418862887, 0.1282361359997127, 0.1699822491656706),
            (0.2676721801253368, 0.6743399888015507, 0.05798783107311244),
            (-0.005381815766387659, 0.0013690602090958254, 1.0930705063171704),
        ),
    ),
    "lin_ap0_scene": RenderingSpace(
        Chromaticities((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770), _ACES_WHITE),
        (
            (0.9382798492772569, -0.004451445812360743, 0.016627523586775668),
            (0.3373688907878375, 0.7295215666902649, -0.06689045747810242),
            (0.0011739508496858622, -0.003710706402052566, 1.0915945063122452),
        ),
    ),
}

# What other applications and older files call the spaces that OpenUSD knows.
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


def rendering_space_name(name: str) -> str:
    """The name of a space to render in, of any of its aliases; ValueError with those known."""
    lower = name.lower()
    lower = ALIASES.get(lower, lower)
    if lower in RENDERING_SPACES:
        return lower
    known = ", ".join(RENDERING_SPACES)
    raise UsageError(f"not a linear RGB colour space: {name!r}; known are {known}")


def rendering_space(name: str) -> RenderingSpace:
    """The space of that name; ValueError with the known names otherwise."""
    return RENDERING_SPACES[rendering_space_name(name)]


def conversion(source: str, target: str) -> Matrix:
    """The 3x3 matrix M that takes linear RGB from one space to another: ``M @ rgb``."""
    to_xyz, from_xyz = rendering_space(source).to_xyz, rendering_space(target).to_xyz
    if from_xyz == to_xyz:
        return np.eye(3)
    return np.linalg.solve(np.array(from_xyz), np.array(to_xyz))


def matrix_to_xyz(chromaticities: Chromaticities) -> Matrix:
    """From linear RGB of any primaries and white to XYZ, the white adapted to D65."""
    colour = colour_science()
    matrix = colour.normalised_primary_matrix(
        np.array(chromaticities[:3]), np.array(chromaticities.white)
    )
    whites = (colour.xy_to_XYZ(np.array(xy)) for xy in (chromaticities.white, D65))
    adapt = colour.adaptation.matrix_chromatic_adaptation_VonKries(*whites, ADAPTATION)
    return np.asarray(adapt @ matrix, dtype=np.float64)


def colour_science() -> ModuleType:
    """Import colour-science, which takes a second and complains about what it could plot with."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module("colour")
