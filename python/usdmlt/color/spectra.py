"""Spectra, illuminants, blackbodies and metals as linear RGB of a rendering space.

The CIE 1931 2° observer, by nanometre from 360 to 830 nm, as colour-science has it:

    X = c ∫ S(λ) x̄(λ) dλ, and so Y and Z.

Light of chromaticity D65 is white, (1, 1, 1), in every space, as is a surface that reflects
everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from usdmlt.color.optical_constants import METALS, optical_constants
from usdmlt.color.spaces import ADAPTATION, D65, DEFAULT, colour_science, rendering_space
from usdmlt.errors import UsageError

LUMENS_PER_WATT = 683.0
WAVELENGTHS = np.arange(360.0, 831.0)
EDGE_COSINE = 1 / 7  # of 82°, where OpenPBR has its specular_color tint the edge

RGB = npt.NDArray[np.float64]
Spectrum = Sequence[float] | npt.NDArray[np.floating]


class Metal(NamedTuple):
    """A metal in linear RGB, as OpenPBR and standard_surface take it.

    ``reflectance``: at normal incidence, F0: `base_color`. ``edge_tint``: what the reflectance at
    82° is of Schlick's, F0 + (1 - F0)(1 - cos θ)^5: `specular_color` of OpenPBR. Both are clipped
    to [0, 1]: gold is redder than Rec.709 can say without adding light, though not than ACEScg.
    """

    reflectance: RGB
    edge_tint: RGB


def emission(
    wavelengths: Spectrum, values: Spectrum, space: str = DEFAULT, normalized: bool = True
) -> RGB:
    """(3,) the colour of light of a spectrum: of luminance 1, as ``inputs:color`` of a UsdLux light
    has it; not ``normalized``: radiance in nit, of ``values`` in W / (m² sr nm).

    ``wavelengths``: in nm, rising; between them the values are linear, outside they are 0. What
    lies outside the space's gamut has negative components: lights need them clipped.
    """
    spectrum = _sampled(wavelengths, values, outside=0.0)
    xyz = LUMENS_PER_WATT * (_observer() @ spectrum)
    if normalized:
        if not xyz[1] > 0:
            raise UsageError("the spectrum has no light that is seen")
        xyz = xyz / xyz[1]
    return _rgb(xyz, space)


def reflectance(wavelengths: Spectrum, values: Spectrum, space: str = DEFAULT) -> RGB:
    """(3,) the colour of a surface that reflects ``values``, each from 0 to 1, under D65.

    ``wavelengths``: in nm, rising; between them the values are linear, outside as at the ends.
    """
    return _reflectance(_sampled(wavelengths, values), space)


def illuminant(name: str, space: str = DEFAULT) -> RGB:
    """(3,) the colour, of luminance 1, of a CIE illuminant: "A", "D50", "FL11", "LED-B3" …"""
    known = colour_science().SDS_ILLUMINANTS
    if name not in known:
        raise UsageError(f"unknown illuminant {name!r}; known are {', '.join(sorted(known))}")
    return emission(known[name].wavelengths, known[name].values, space)


def blackbody(kelvin: float, space: str = DEFAULT) -> RGB:
    """(3,) the colour, of luminance 1, of a blackbody by Planck's law; below about 1900 K it is
    outside of Rec.709.

    UsdLux's colour temperature is an approximation of this, and is rendered as UsdLux has it.
    """
    return emission(WAVELENGTHS, _planck(kelvin), space)


def blackbody_radiance(kelvin: float, space: str = DEFAULT) -> RGB:
    """(3,) the radiance of a blackbody in nit, by Planck's law; its colour is :func:`blackbody`."""
    return emission(WAVELENGTHS, 1e-9 * _planck(kelvin), space, normalized=False)


def _planck(kelvin: float) -> npt.NDArray[np.float64]:
    """W / (m² sr m) by nanometre."""
    if not 100 <= kelvin <= 1e6:
        raise UsageError(f"the temperature must be from 100 to 1e6 kelvin, not {kelvin}")
    return np.asarray(colour_science().colorimetry.planck_law(WAVELENGTHS * 1e-9, kelvin))


def metal(
    name: str | None = None,
    space: str = DEFAULT,
    *,
    wavelengths: Spectrum | None = None,
    n: Spectrum | None = None,
    k: Spectrum | None = None,
) -> Metal:
    """A metal by name (:func:`metals`), or by its measured index n + ik at wavelengths in nm."""
    if name is not None:
        if name not in METALS:
            raise UsageError(f"unknown metal {name!r}; known are {', '.join(METALS)}")
        wavelengths, n, k = optical_constants(name)
    if wavelengths is None or n is None or k is None:
        raise UsageError("give the name of a metal, or wavelengths, n and k")
    index = _sampled(wavelengths, n) + 1j * _sampled(wavelengths, k)
    facing = _reflectance(fresnel(index, 1.0), space)
    edge = _reflectance(fresnel(index, EDGE_COSINE), space)
    facing = np.clip(facing, 0, 1)
    return Metal(facing, np.clip(edge / (facing + (1 - facing) * (1 - EDGE_COSINE) ** 5), 0, 1))


def metals() -> tuple[str, ...]:
    """The names of the metals that are known."""
    return tuple(METALS)


def fresnel(index: npt.NDArray[np.complex128], cosine: float) -> npt.NDArray[np.float64]:
    """The reflectance of a conductor in air for unpolarised light (Born and Wolf, 1.5.2)."""
    transmitted = np.sqrt(1 - (1 - cosine**2) / index**2)
    perpendicular = (cosine - index * transmitted) / (cosine + index * transmitted)
    parallel = (index * cosine - transmitted) / (index * cosine + transmitted)
    return np.asarray((np.abs(perpendicular) ** 2 + np.abs(parallel) ** 2) / 2)


def _sampled(
    wavelengths: Spectrum, values: Spectrum, outside: float | None = None
) -> npt.NDArray[np.float64]:
    """By nanometre; ValueError for what is no table."""
    x, y = np.asarray(wavelengths, np.float64), np.asarray(values, np.float64)
    if x.ndim != 1 or x.shape != y.shape or len(x) == 0:
        raise UsageError("a spectrum is as many values as wavelengths, one at least")
    if not (np.isfinite(x).all() and np.isfinite(y).all() and (np.diff(x) > 0).all()):
        raise UsageError("a spectrum is finite values at rising wavelengths")
    if x[-1] < WAVELENGTHS[0] or x[0] > WAVELENGTHS[-1]:
        raise UsageError(f"no wavelength is visible from {x[0]:g} to {x[-1]:g}: they are in nm")
    return np.asarray(np.interp(WAVELENGTHS, x, y, left=outside, right=outside))


def _reflectance(spectrum: npt.NDArray[np.float64], space: str) -> RGB:
    d65 = colour_science().SDS_ILLUMINANTS["D65"]
    light = np.interp(WAVELENGTHS, d65.wavelengths, d65.values)
    xyz = _observer() @ (light * spectrum)
    white = _observer() @ light
    return _rgb(_adaptation(tuple(white / white[1])) @ (xyz / white[1]), space)


def _rgb(xyz: npt.NDArray[np.float64], space: str) -> RGB:
    return np.asarray(np.linalg.solve(np.array(rendering_space(space).to_xyz), xyz))


@cache
def _observer() -> npt.NDArray[np.float64]:
    """(3, 471) x̄, ȳ and z̄ of the CIE 1931 2° standard observer."""
    observer = colour_science().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    columns = np.asarray(observer.values, np.float64).T
    return np.array([np.interp(WAVELENGTHS, observer.wavelengths, column) for column in columns])


@cache
def _adaptation(white: tuple[float, ...]) -> npt.NDArray[np.float64]:
    """From an integrated D65, whose last digits depend on the tables, to that of the spaces."""
    colour = colour_science()
    adapt = colour.adaptation.matrix_chromatic_adaptation_VonKries
    return np.asarray(adapt(np.array(white), colour.xy_to_XYZ(np.array(D65)), ADAPTATION))
