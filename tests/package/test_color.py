"""Rendering colour spaces."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf

from usdmlt import color


@pytest.mark.parametrize("name", color.RENDERING_SPACES)
def test_spaces_are_openusds_of_the_same_name(name: str) -> None:
    """Colours read from a stage (OpenUSD's matrices) and written to a file mean the same.

    OpenUSD adapts ACES's primaries to D65 beforehand, so matrices are compared.
    """
    to_xyz = [
        np.array(Gf.ColorSpace(space).GetRGBToXYZ(), dtype=float).reshape(3, 3)
        for space in (name, "lin_rec709_scene")
    ]
    openusd = np.linalg.inv(to_xyz[1]) @ to_xyz[0]
    np.testing.assert_allclose(color.conversion(name, "lin_rec709_scene"), openusd, atol=2e-3)


@pytest.mark.parametrize("source", color.RENDERING_SPACES)
@pytest.mark.parametrize("target", ["lin_rec709_scene", "lin_ap1_scene"])
def test_conversions_keep_white_and_can_be_undone(source: str, target: str) -> None:
    matrix = color.conversion(source, target)
    np.testing.assert_allclose(matrix @ np.ones(3), np.ones(3), atol=2e-4)
    np.testing.assert_allclose(matrix @ color.conversion(target, source), np.eye(3), atol=1e-4)


def test_acescg_to_rec709_is_the_published_matrix() -> None:
    """The matrix of the ACES reference implementation (Bradford from D60 to D65)."""
    published = [
        [1.70505, -0.62179, -0.08326],
        [-0.13026, 1.14080, -0.01055],
        [-0.02400, -0.12897, 1.15297],
    ]
    matrix = color.conversion("lin_ap1_scene", "lin_rec709_scene")
    np.testing.assert_allclose(matrix, published, atol=2e-4)


def test_unknown_spaces_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"unknown colour space 'xyz'.*lin_rec709_scene"):
        color.rendering_space("xyz")
