"""The report in a real browser: Debian's chromium, driven by playwright."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from usdmlt.image import Image
from usdmlt.testing import comparison, report

SIZE = (48, 64)


@pytest.fixture
def page_file(tmp_path: Path) -> Path:
    """Of a red picture against a blue reference."""
    images = []
    for colour in ((0, 0, 1, 1), (1, 0, 0, 1)):
        rgba = np.broadcast_to(np.array(colour, np.float32), (*SIZE, 4))
        images.append(Image.from_rgba(rgba, metadata={"seed": 7}))
    result = comparison.compare(*images)
    entry = report.Entry("red & <blue>", result, {"accept": "pytest a.py --usdmlt-update"})
    path = tmp_path / "report.html"
    path.write_text(report.page([report.section(entry)]))
    return path


def test_the_page_names_no_address(page_file: Path) -> None:
    text = page_file.read_text()
    assert "://" not in text and "default-src 'none'" in text
    assert "red &amp; &lt;blue&gt;" in text
    assert all(source.startswith("data:") for source in re.findall(r'src="([^"]*)', text))


@pytest.fixture
def page(browser: Any, page_file: Path) -> Iterator[tuple[Any, list[str]]]:
    """The page as the browser has it, and what it asked for."""
    opened = browser.new_page()
    asked: list[str] = []
    opened.on("request", lambda request: asked.append(request.url))
    opened.on("pageerror", lambda error: asked.append(f"error: {error}"))
    opened.goto(page_file.as_uri())
    yield opened, asked
    opened.close()


def test_the_slider_uncovers_the_picture(page: tuple[Any, list[str]], page_file: Path) -> None:
    opened, asked = page
    place = opened.locator(".slider").bounding_box()
    slider = opened.locator("input[type=range]")

    def shares() -> tuple[float, float]:
        """Of red, the picture, and of blue, the reference, on a screenshot."""
        shot = page_file.with_name("shot.png")
        opened.screenshot(path=str(shot), clip=place)
        pixels = read(shot)
        return float(np.mean(pixels[..., 0] > 200)), float(np.mean(pixels[..., 2] > 200))

    assert shares() == pytest.approx((0.5, 0.5), abs=0.05)
    mouse = opened.mouse
    mouse.move(place["x"] + place["width"] / 2, place["y"] + place["height"] / 2)
    mouse.down()
    mouse.move(place["x"] + place["width"] / 4, place["y"] + 5)
    mouse.up()
    assert shares() == pytest.approx((0.25, 0.75), abs=0.05)
    for key, expected in (("End", (1.0, 0.0)), ("Home", (0.0, 1.0))):
        slider.focus()
        opened.keyboard.press(key)
        assert shares() == pytest.approx(expected, abs=0.05)
    assert [url for url in asked if not url.startswith("data:")] == [page_file.as_uri()]


def test_all_pictures_are_shown(page: tuple[Any, list[str]]) -> None:
    opened, _ = page
    widths = opened.eval_on_selector_all("img", "all => all.map(image => image.naturalWidth)")
    assert len(widths) >= 4 and set(widths) == {SIZE[1]}
    assert "different" in opened.inner_text("h2")


def read(path: Path) -> np.ndarray:
    """(height, width, 3), 0 to 255."""
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(str(path))
    pixels = file.read_image("uint8")
    file.close()
    return pixels[..., :3]
