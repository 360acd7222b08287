"""Rendering colour spaces: their matrices against colour-science, OpenColorIO and OpenUSD."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf

from usdmlt import color


@pytest.mark.parametrize("name", color.RENDERING_SPACES)
def test_spaces_are_openusds_of_the_same_name(name: str) -> None:
    """Colours read from a stage (OpenUSD's matrices) and written to a file mean the same.

    OpenUSD adapts ACES's primaries to D65 beforehand, and rounds them, so matrices are compared.
    """
    to_xyz = [
        np.array(Gf.ColorSpace(space).GetRGBToXYZ(), dtype=float).reshape(3, 3)
        for space in (name, "lin_rec709_scene")
    ]
    openusd = np.linalg.inv(to_xyz[1]) @ to_xyz[0]
    np.testing.assert_allclose(color.conversion(name, "lin_rec709_scene"), openusd, atol=2e-3)


# OpenColorIO's names, the same since its first built-in configuration.
OCIO_NAMES = {
    "lin_rec709_scene": "lin_rec709",
    "lin_rec2020_scene": "lin_rec2020",
    "lin_p3d65_scene": "lin_p3d65",
    "lin_ap1_scene": "ACEScg",
    "lin_ap0_scene": "ACES2065-1",
}
OCIO_CONFIG = "ocio://cg-config-v1.0.0_aces-v1.3_ocio-v2.1"


@pytest.mark.parametrize("source", OCIO_NAMES)
@pytest.mark.parametrize("target", OCIO_NAMES)
def test_conversions_are_opencolorios(source: str, target: str) -> None:
    rows = oiio.ImageBuf(np.eye(3, dtype=np.float32)[None])
    converted = oiio.ImageBufAlgo.colorconvert(
        rows, OCIO_NAMES[source], OCIO_NAMES[target], colorconfig=OCIO_CONFIG
    )
    assert not converted.has_error, converted.geterror()
    columns = converted.get_pixels(oiio.FLOAT)[0]
    np.testing.assert_allclose(color.conversion(source, target).T, columns, atol=1e-5)


@pytest.mark.parametrize("name", color.RENDERING_SPACES)
def test_matrices_are_what_colour_science_makes_of_the_chromaticities(name: str) -> None:
    space = color.rendering_space(name)
    again = color.matrix_to_xyz(space.chromaticities)
    np.testing.assert_allclose(space.to_xyz, again, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["ACEScg", "acescg", "lin_ap1", "lin_ap1_scene"])
def test_spaces_have_the_names_that_other_applications_give_them(name: str) -> None:
    assert color.rendering_space_name(name) == "lin_ap1_scene"


@pytest.mark.parametrize("source", color.RENDERING_SPACES)
@pytest.mark.parametrize("target", ["lin_rec709_scene", "lin_ap1_scene"])
def test_conversions_keep_white_and_can_be_undone(source: str, target: str) -> None:
    matrix = color.conversion(source, target)
    np.testing.assert_allclose(matrix @ np.ones(3), np.ones(3), atol=1e-12)
    np.testing.assert_allclose(matrix @ color.conversion(target, source), np.eye(3), atol=1e-12)


def test_acescg_to_rec709_is_the_published_matrix() -> None:
    """The matrix of the ACES reference implementation (Bradford from D60 to D65)."""
    published = [
        [1.70505, -0.62179, -0.08326],
        [-0.13026, 1.14080, -0.01055],
        [-0.02400, -0.12897, 1.15297],
    ]
    matrix = color.conversion("lin_ap1_scene", "lin_rec709_scene")
    np.testing.assert_allclose(matrix, published, atol=2e-4)


@pytest.mark.parametrize("name", ["srgb_rec709_scene", "xyz", ""])
def test_unknown_spaces_are_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(ValueError, match=rf"not a linear RGB .*: '{name}'.*lin_rec709_scene"):
        color.rendering_space(name)
