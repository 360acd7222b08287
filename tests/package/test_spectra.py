"""Spectra, illuminants, blackbodies and metals, against colour-science, UsdLux and measurements."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from pxr import UsdLux

from usdmlt import color
from usdmlt.color import spectra
from usdmlt.color.optical_constants import optical_constants

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour

# It resamples what has another step than a nanometre, and says so.
pytestmark = pytest.mark.filterwarnings("ignore:Aligning")

REC709 = np.array(color.rendering_space("lin_rec709_scene").to_xyz)
SPACES = ["lin_rec709_scene", "lin_rec2020_scene", "lin_ap1_scene"]


@pytest.mark.parametrize("name", ["A", "D50", "FL11", "LED-B3"])
def test_illuminants_are_colour_sciences(name: str) -> None:
    """Integrated by colour-science itself, and of luminance 1."""
    xyz = colour.sd_to_XYZ(colour.SDS_ILLUMINANTS[name], method="Integration")
    np.testing.assert_allclose(REC709 @ color.illuminant(name), xyz / xyz[1], atol=2e-3)
    assert (REC709 @ color.illuminant(name))[1] == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("space", SPACES)
def test_daylight_and_what_reflects_everything_are_white(space: str) -> None:
    np.testing.assert_allclose(color.illuminant("D65", space), 1, atol=5e-4)  # of 4-digit D65
    np.testing.assert_allclose(color.reflectance([380, 780], [1, 1], space), 1, atol=1e-12)
    np.testing.assert_allclose(color.reflectance([380, 780], [0.18, 0.18], space), 0.18, atol=1e-12)


@pytest.mark.parametrize("kelvin", [2000, 3200, 5000, 6500, 10000])
def test_blackbodies_are_plancks_and_nearly_usdluxs(kelvin: float) -> None:
    xyz = colour.sd_to_XYZ(colour.sd_blackbody(kelvin), method="Integration")
    rgb = color.blackbody(kelvin)
    np.testing.assert_allclose(REC709 @ rgb, xyz / xyz[1], atol=1e-3)
    np.testing.assert_allclose(rgb, UsdLux.BlackbodyTemperatureAsRgb(kelvin), atol=5e-3)


def test_radiance_is_in_nit() -> None:
    """1 W / (m² sr) of green light of 555 nm, where an eye has 683 lumens per watt."""
    rgb = color.emission([554, 555, 556], [0, 1, 0], normalized=False)
    assert (REC709 @ rgb)[1] == pytest.approx(683, rel=1e-3)


def test_beyond_their_tables_light_is_dark_and_surfaces_stay_as_they_are() -> None:
    wavelengths, values = np.array([500.0, 520.0, 540.0]), np.array([1.0, 2.0, 1.0])
    dark = color.emission([499.99, *wavelengths, 540.01], [0, *values, 0], normalized=False)
    np.testing.assert_allclose(
        color.emission(wavelengths, values, normalized=False), dark, atol=1e-9
    )
    wide = color.reflectance([360, *wavelengths, 830], [0.2, 0.2, 0.6, 0.4, 0.4])
    np.testing.assert_allclose(color.reflectance(wavelengths, [0.2, 0.6, 0.4]), wide, atol=1e-12)


@pytest.mark.parametrize("space", SPACES)
def test_a_spectrum_is_the_same_colour_in_every_space(space: str) -> None:
    wavelengths, values = [400, 500, 550, 600, 700], [0.1, 0.3, 0.8, 0.4, 0.9]
    to_rec709 = color.conversion(space, "lin_rec709_scene")
    for of in (color.reflectance, color.emission):
        expected = of(wavelengths, values)
        np.testing.assert_allclose(to_rec709 @ of(wavelengths, values, space), expected, atol=1e-12)


def test_patches_of_a_colour_checker_are_what_was_measured_of_them() -> None:
    """Their spectra under D65 against their published L*a*b* (after Bradford, D50)."""
    spectra_of = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    published = colour.CCS_COLOURCHECKERS["BabelColor Average"]
    white = colour.xy_to_XYZ(published.illuminant)
    d65 = colour.xy_to_XYZ(color.rendering_space("lin_rec709_scene").chromaticities.white)
    adapt = colour.adaptation.matrix_chromatic_adaptation_VonKries(white, d65, "Bradford")
    assert len(spectra_of) == 24
    for name, xyY in published.data.items():
        patch = spectra_of[name]
        xyz = REC709 @ color.reflectance(patch.wavelengths, patch.values)
        lab = [
            colour.XYZ_to_Lab(v, colour.XYZ_to_xy(d65))
            for v in (xyz, adapt @ colour.xyY_to_XYZ(xyY))
        ]
        assert np.linalg.norm(lab[0] - lab[1]) < 3.5, name  # other light is not Bradford's alone


# Reflectance at normal incidence in sRGB's primaries, as the literature of rendering has them
# (N. Hoffman, SIGGRAPH 2012 course, table 1, linear), from other measurements.
HOFFMAN = {
    "titanium": (0.542, 0.497, 0.449),
    "chromium": (0.549, 0.556, 0.554),
    "iron": (0.562, 0.565, 0.578),
    "nickel": (0.660, 0.609, 0.526),
    "copper": (0.955, 0.638, 0.538),
    "gold": (1.022, 0.782, 0.344),
    "aluminium": (0.913, 0.922, 0.924),
    "silver": (0.972, 0.960, 0.915),
}


@pytest.mark.parametrize("name", HOFFMAN)
def test_metals_look_as_they_are_known_to(name: str) -> None:
    np.testing.assert_allclose(color.metal(name).reflectance, HOFFMAN[name], atol=0.1)


@pytest.mark.parametrize("name", color.metals())
def test_metals_reflect_no_more_than_there_is(name: str) -> None:
    for space in SPACES:
        for rgb in color.metal(name, space):
            assert (rgb >= 0).all() and (rgb <= 1).all()


def test_a_metal_of_constant_index_is_fresnels_at_both_angles() -> None:
    """n = 0.5, k = 3: ((n - 1)² + k²) / ((n + 1)² + k²) head on, and at 82° by real arithmetic."""
    metal = color.metal(wavelengths=[400, 700], n=[0.5, 0.5], k=[3, 3])
    facing = (0.5**2 + 9) / (1.5**2 + 9)
    np.testing.assert_allclose(metal.reflectance, facing, atol=1e-12)
    # Born and Wolf 13.2 with a² + b² = |η² - sin²|.
    cos, n2, k2 = 1 / 7, 0.25, 9.0
    sin2 = 1 - cos**2
    both = np.sqrt((n2 - k2 - sin2) ** 2 + 4 * n2 * k2)
    a = np.sqrt((both + n2 - k2 - sin2) / 2)
    s = (both + cos**2 - 2 * a * cos) / (both + cos**2 + 2 * a * cos)
    tangent = sin2 / cos
    p = s * (both + tangent**2 - 2 * a * tangent) / (both + tangent**2 + 2 * a * tangent)
    schlick = facing + (1 - facing) * (6 / 7) ** 5
    np.testing.assert_allclose(metal.edge_tint, (s + p) / 2 / schlick, atol=1e-12)


def test_tables_of_metals_are_whole() -> None:
    for name in color.metals():
        wavelengths, n, k = optical_constants(name)
        assert len(wavelengths) == len(n) == len(k) >= 15
        assert (np.diff(wavelengths) > 0).all() and (n > 0).all() and (k > 0).all()
        assert wavelengths[0] < spectra.WAVELENGTHS[0] and wavelengths[-1] > spectra.WAVELENGTHS[-1]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: color.metal("unobtainium"), "unknown metal 'unobtainium'; known are aluminium"),
        (lambda: color.metal(), "give the name of a metal"),
        (lambda: color.metal(wavelengths=[500], n=[1, 2], k=[1]), "as many values as wavelengths"),
        (lambda: color.illuminant("X"), "unknown illuminant 'X'; known are A, B, C, D50"),
        (lambda: color.blackbody(0), "from 100 to 1e6 kelvin"),
        (lambda: color.emission([0.4, 0.7], [1, 1]), "they are in nm"),
        (lambda: color.emission([500, 400], [1, 1]), "rising wavelengths"),
        (lambda: color.emission([400, 500], [1, np.nan]), "finite values"),
        (lambda: color.emission([400, 500], [0, 0]), "no light that is seen"),
        (lambda: color.reflectance([400, 500], [1, 1], "srgb"), "not a linear RGB colour space"),
    ],
)
def test_what_makes_no_sense_is_refused(call, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=message):
        call()
