"""The page of `usdmlt view` in a real browser: Debian's chromium, driven by playwright."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from usdmlt import Image, color, layers, read_image, views
from usdmlt.cli import main

SIZE = (30, 40)
LAYERS = ("color", "alpha", "error", "CryptoObject", "N", "Z", "objectId")

DRAWN = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An EXR in ACEScg with a layer of each kind, and the page beside it."""
    rng = np.random.default_rng(5)
    channels: dict[str, np.ndarray] = {}
    for name in LAYERS:
        count = len(layers.KNOWN[name].channels)
        shape = SIZE if count == 1 else (*SIZE, count)
        channels[name] = rng.uniform(0, 1, shape).astype(np.float32)
    channels["objectId"] = rng.integers(0, 2**24, SIZE, dtype=np.uint32)
    channels["color"][3, 7] = 65504, 6e-8, 0.0
    channels["error"][0, 0] = np.nan
    channels["Z"][0, 0] = np.inf
    numbers = {"/World/Table": int(channels["objectId"][2, 5]), "/World/Lamp": 2**24 - 1}
    hashes = {"/World/Lamp": channels["CryptoObject"][2, 5, 0].tobytes()[::-1].hex()}
    metadata = {
        "stage": "</script><b>.usda",
        "seed": 7,
        "objectIds": json.dumps(numbers),
        "cryptomatte/ab12/name": "CryptoObject",
        "cryptomatte/ab12/manifest": json.dumps(hashes),
    }
    path = tmp_path_factory.mktemp("view") / "shot & <more>.exr"
    Image(channels, color_space="lin_ap1_scene", metadata=metadata).write(path)
    assert main(["view", str(path), "-q"]) == 0
    return path


def test_the_page_names_no_address_and_escapes_what_it_says(picture: Path) -> None:
    text = picture.with_suffix(".html").read_text()
    assert "://" not in text and "default-src 'none'" in text
    assert "<title>shot &amp; &lt;more&gt;.exr</title>" in text
    assert "</script><b>" not in text
    assert not re.findall(r"(?:src|href)=", text)


@pytest.fixture(scope="module")
def opened(browser: Any, picture: Path) -> Iterator[Any]:
    """The page as the browser has it; it asks for nothing and has no errors."""
    url = picture.with_suffix(".html").as_uri()
    page = browser.new_page(viewport={"width": 1000, "height": 600})
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: asked.append(f"error: {error}"))
    page.goto(url)
    page.wait_for_selector("body[data-ready]")
    yield page
    assert asked == [url]


@pytest.fixture
def page(opened: Any) -> Any:
    """At the first layer, exposure 0 and eight screen pixels a pixel."""
    opened.evaluate("chooseLayer(0); setExposure(0); state.held = null; centre(8)")
    opened.mouse.move(500, 5)
    return opened


def place(page: Any, x: int, y: int) -> tuple[float, float]:
    """The middle of a pixel in the window."""
    stage = page.locator("#stage").bounding_box()
    left, top, zoom = page.evaluate("[state.x, state.y, state.zoom]")
    return stage["x"] + left + (x + 0.5) * zoom, stage["y"] + top + (y + 0.5) * zoom


def told(page: Any) -> dict[str, float]:
    """The values in the line at the bottom, by channel."""
    read = "all => all.map(one => [one.dataset.channel, one.textContent])"
    return {c: float(v) for c, v in page.eval_on_selector_all("#values span", read)}


def screen(page: Any, picture: Path, x: int, y: int) -> list[int]:
    """The colour of a pixel on a screenshot."""
    shot = picture.with_name("shot.png")
    page.evaluate(DRAWN)
    at = place(page, x, y)
    page.screenshot(path=str(shot))
    return oiio.ImageInput.open(str(shot)).read_image("uint8")[int(at[1]), int(at[0]), :3].tolist()


def test_pixel_values_are_those_of_the_exr(page: Any, picture: Path) -> None:
    image = read_image(picture)
    for number, name in enumerate(LAYERS):
        page.locator(".layer").nth(number).click()
        for x, y in ((0, 0), (7, 3), (39, 29)):
            page.mouse.move(*place(page, x, y))
            assert page.inner_text("#position") == f"x {x}  y {y}"
            expected = np.atleast_1d(image[name][y, x])
            names = [channel.rpartition(".")[2] for channel in layers.KNOWN[name].channels]
            assert list(told(page)) == names
            values = np.array(list(told(page).values()))
            np.testing.assert_allclose(values, expected, rtol=5e-7, err_msg=name)


def test_the_exposure_moves_the_picture_by_stops(page: Any, picture: Path) -> None:
    image = read_image(picture)
    for key, stops in ((None, 0.0), ("ArrowRight", 0.5), ("ArrowLeft", 0.0), ("ArrowLeft", -0.5)):
        if key:
            page.keyboard.press(key)
        assert float(page.input_value("#exposure")) == stops
        shown = views.encode(image["color"] * np.float32(2**stops), "lin_ap1_scene")
        for x, y in ((20, 10), (5, 25)):
            found = screen(page, picture, x, y)
            assert np.abs(np.array(found) - shown[y, x]).max() <= 1
    page.fill("#exposure", "3")
    assert page.inner_text("#exposure-value") == "+3.0"


def test_layers_are_switched_by_click_and_by_key(page: Any, picture: Path) -> None:
    image = read_image(picture)
    selected = "document.querySelector('[aria-selected=true] b').textContent"
    page.locator(".layer").nth(LAYERS.index("N")).click()
    assert page.evaluate(selected) == "N"
    # Directions between 0 and 1 are shown from their least to their greatest.
    low, high = (np.quantile(image["N"], q, axis=(0, 1)) for q in (0.002, 0.998))
    expected = 255 * (image["N"][10, 20] - low) / (high - low)
    assert np.abs(np.array(screen(page, picture, 20, 10)) - expected).max() <= 2
    page.keyboard.press("ArrowDown")
    assert page.evaluate(selected) == "Z" and page.is_visible("#legend")
    page.keyboard.press("ArrowUp")
    assert page.evaluate(selected) == "N" and not page.is_visible("#legend")


def test_numbers_have_colours_of_their_own(page: Any, picture: Path) -> None:
    page.locator(".layer").nth(LAYERS.index("objectId")).click()
    colours = {tuple(screen(page, picture, x, 4)) for x in range(6)}
    assert len(colours) == 6


def test_numbers_are_told_by_name(page: Any) -> None:
    for layer, name in (("objectId", "/World/Table"), ("CryptoObject", "/World/Lamp")):
        page.locator(".layer").nth(LAYERS.index(layer)).click()
        page.mouse.move(*place(page, 5, 2))
        assert page.inner_text("#name") == name
        page.mouse.move(*place(page, 6, 2))
        assert page.inner_text("#name") == ""


def test_one_channel_is_shown_alone(page: Any, picture: Path) -> None:
    image = read_image(picture)
    page.keyboard.press("g")
    green = views.encode(np.repeat(image["color"][..., 1:2], 3, axis=2))
    assert np.abs(np.array(screen(page, picture, 20, 10)) - green[10, 20]).max() <= 1
    assert page.get_attribute("#channel-buttons button:nth-child(2)", "aria-pressed") == "true"
    page.keyboard.press("g")
    shown = views.encode(image["color"], "lin_ap1_scene")[10, 20]
    assert np.abs(np.array(screen(page, picture, 20, 10)) - shown).max() <= 1


def test_zoom_keeps_the_place_under_the_pointer(page: Any) -> None:
    at = place(page, 12, 9)
    page.mouse.move(*at)
    page.mouse.wheel(0, -480)
    assert page.evaluate("state.zoom") == 32
    assert page.inner_text("#position") == "x 12  y 9"
    assert place(page, 12, 9) == pytest.approx(at, abs=16)
    page.keyboard.press("1")
    assert page.evaluate("state.zoom") == 1
    page.keyboard.press("f")
    assert page.evaluate("[state.zoom, width * state.zoom <= stage.clientWidth]") == [8, True]


def test_a_click_holds_a_pixel(page: Any, picture: Path) -> None:
    image = read_image(picture)
    page.mouse.click(*place(page, 30, 20))
    page.mouse.move(*place(page, 2, 2))
    assert page.inner_text("#position") == "x 30  y 20"
    page.keyboard.press("ArrowDown")
    assert told(page)["A"] == pytest.approx(float(image["alpha"][20, 30]), rel=5e-7)


def test_large_pictures_are_drawn_coarsely_and_then_finished(browser: Any, tmp_path: Path) -> None:
    Image.from_rgba(np.full((1000, 1100, 4), 0.5)).write(tmp_path / "a.exr")
    assert main(["view", str(tmp_path / "a.exr"), "-q"]) == 0
    page = browser.new_page()
    page.goto((tmp_path / "a.html").as_uri())
    page.wait_for_selector("body[data-ready]")
    page.evaluate(DRAWN)
    steps = """new Promise(done => {
        clearTimeout(finishing);
        const steps = [], all = shadeAll;
        window.shadeAll = (step) => {
            all(step);
            steps.push([step, shown.width, shown.height]);
            if (step === 1) done(steps);
        };
        setExposure(1);
    })"""
    assert page.evaluate(steps) == [[2, 550, 500], [1, 1100, 1000]]
    page.close()


def test_it_says_how_the_picture_was_made(page: Any) -> None:
    page.click("#about-button")
    said = page.inner_text("#about")
    assert "lin_ap1_scene" in said and "</script><b>.usda" in said and "seed" in said
    page.click("#about-button")
    assert not page.is_visible("#about")


def test_what_cannot_be_viewed_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", str(tmp_path / "none.exr")]) == 1
    assert "cannot read" in capsys.readouterr().err
    (tmp_path / "text.exr").write_text("no picture")
    assert main(["view", str(tmp_path / "text.exr")]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1
    Image.from_rgba(np.zeros((2, 2, 4))).write(tmp_path / "a.exr")
    output = tmp_path / "nowhere" / "a.html"
    assert main(["view", str(tmp_path / "a.exr"), "-o", str(output)]) == 1
    assert "cannot write" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.html"))


def test_any_exr_can_be_viewed(tmp_path: Path) -> None:
    """Of another renderer, without a colour space, with layers that are none of ours."""
    spec = oiio.ImageSpec(4, 3, 5, "half")
    spec.channelnames = ("R", "G", "B", "mist.V", "flow.x")
    file = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    file.open(str(tmp_path / "a.exr"), spec)
    file.write_image(np.ones((3, 4, 5), np.float32))
    file.close()
    assert main(["view", str(tmp_path / "a.exr"), "-q"]) == 0
    assert color.DEFAULT in (tmp_path / "a.html").read_text()
