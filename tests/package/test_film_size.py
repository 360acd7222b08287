"""What films take in memory, as docs/long-renders.md says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from usdmlt.native import core

DOCUMENT = Path(__file__).parents[2] / "docs" / "long-renders.md"
PIXELS_4K = 3840 * 2160


def bytes_per_pixel(splats: bool, error: bool, layers: int) -> float:
    film = core().Film(64, 32, 1.0, 1.0, splats=splats, error=error, layers=layers)
    return sum(plane.nbytes for plane in film.planes().values()) / (64 * 32)


@pytest.mark.parametrize("splats", [False, True])
def test_a_4k_picture_with_ten_colour_layers_has_a_film_below_2_5_gib(splats: bool) -> None:
    assert bytes_per_pixel(splats=splats, error=True, layers=10) * PIXELS_4K < 2.5 * 2**30


@pytest.mark.parametrize("layers", [0, 10])
@pytest.mark.parametrize(("name", "splats"), [("path", False), ("bdpt, mlt", True)])
def test_the_document_has_the_sizes_of_films(name, splats, layers) -> None:
    with_error, without = (bytes_per_pixel(splats, error, layers) for error in (True, False))
    size = with_error * PIXELS_4K / 2**30
    row = f"| {name} | {layers} | {with_error:.0f} | {without:.0f} |"
    found = re.search(re.escape(row) + r".* (\d\.\d\d) GiB \|$", DOCUMENT.read_text(), re.M)
    assert found, row
    assert float(found[1]) == pytest.approx(size, abs=0.006)
