"""Views: what OpenColorIO makes of a picture, and what is said where it cannot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from usdmlt import Error, Image, color, views
from usdmlt.cli import main

CONFIG = """ocio_profile_version: 2
search_path: ""
roles: {scene_linear: ours, default: data}
file_rules: [!<Rule> {name: Default, colorspace: default}]
displays:
  Projector:
    - !<View> {name: Dark, colorspace: half}
    - !<View> {name: Plain, colorspace: ours}
active_displays: []
active_views: []
colorspaces:
  - !<ColorSpace> {name: ours, aliases: [LIN_AP1], isdata: false}
  - !<ColorSpace>
    name: half
    from_scene_reference: !<MatrixTransform>
      matrix: [.5, 0, 0, 0, 0, .5, 0, 0, 0, 0, .5, 0, 0, 0, 0, 1]
  - !<ColorSpace> {name: data, isdata: true}
"""


@pytest.fixture
def own_config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "own.ocio"
    path.write_text(CONFIG)
    monkeypatch.setenv("OCIO", str(path))
    return path


@pytest.fixture(autouse=True)
def no_config(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCIO", raising=False)


def row(*values: float) -> np.ndarray:
    """Grey pixels."""
    return np.repeat(np.array(values, np.float32)[None, :, None], 3, axis=2)


def test_srgb_is_the_curve_of_the_standard_without_a_tone_curve() -> None:
    """IEC 61966-2-1, at 10 000 values and beyond both ends."""
    linear = np.append(np.linspace(-0.1, 1.1, 10_000, dtype=np.float32), [np.nan, np.inf, -np.inf])
    inside = np.clip(np.nan_to_num(linear.astype(np.float64)), 0, 1)
    curve = np.where(inside <= 0.0031308, 12.92 * inside, 1.055 * inside ** (1 / 2.4) - 0.055)
    found = views.encode(row(*linear))[0, :, 0]
    np.testing.assert_allclose(found, 255 * curve, atol=0.5 + 2e-3)


@pytest.mark.parametrize("space", color.RENDERING_SPACES)
def test_srgb_converts_the_primaries(space: str) -> None:
    rng = np.random.default_rng(1)
    rec709 = rng.uniform(0.05, 0.95, (4, 5, 3))
    picture = rec709 @ color.conversion("lin_rec709_scene", space).T
    expected = views.encode(rec709).astype(int)
    assert np.abs(views.encode(picture, space).astype(int) - expected).max() <= 1


def test_disabled_is_the_linear_values_clipped() -> None:
    assert views.encode(row(-1, 0, 0.5, 2), view="disabled")[0, :, 0].tolist() == [0, 0, 128, 255]


def test_aces_views_have_a_tone_curve_and_are_found_by_a_part_of_their_name() -> None:
    grey = row(0.18, 1, 8)
    found = views.encode(grey, view="aces")[0, :, 0]
    assert views.find("ACES").view.startswith("ACES")
    assert 80 < found[0] < 130 and found[1] < 255 and found[1] < found[2]
    np.testing.assert_array_equal(views.encode(grey, view="openColorIO")[0, :, 0], found)
    whole = f"{views.find('ACES').display}/{views.find('ACES').view}"
    np.testing.assert_array_equal(views.encode(grey, view=whole)[0, :, 0], found)


def test_ocio_is_honoured_and_leaves_srgb_alone(own_config: Path) -> None:
    grey = row(0.5)
    plain = views.encode(grey)
    assert views.encode(grey, "lin_ap1_scene", "Dark")[0, 0].tolist() == [64, 64, 64]
    assert views.encode(grey, "lin_ap1_scene", "Projector/plain")[0, 0].tolist() == [128] * 3
    # Rec.709, which that configuration does not have, by way of ACEScg, which it has.
    assert views.encode(grey, "lin_rec709_scene", "Dark")[0, 0].tolist() == [64, 64, 64]
    assert views.find("openColorIO") == (str(own_config), "Projector", "Dark")
    assert plain[0, 0].tolist() == [188, 188, 188]


def test_views_differ_by_display() -> None:
    red = np.float32([[[0.8, 0.05, 0.05]]])
    other = next(d for d in oiio.ColorConfig(views.BUILT_IN).getDisplayNames() if "P3" in d)
    there = views.encode(red, view=f"{other}/Un-tone-mapped")
    assert there[0, 0, 0] < views.encode(red)[0, 0, 0]  # P3's red is further out


@pytest.mark.parametrize("extension", ["png", "jpg", "jpeg"])
def test_files_show_the_view(tmp_path: Path, extension: str) -> None:
    rgba = np.full((16, 16, 4), 0.18, np.float32)
    path = tmp_path / f"a.{extension}"
    for view in ("sRGB", "ACES", "disabled"):
        Image.from_rgba(rgba, color_space="lin_ap1_scene").write(path, view)
        pixels = oiio.ImageInput.open(str(path)).read_image("uint8")
        expected = views.encode(rgba[..., :3], "lin_ap1_scene", view)
        assert np.abs(pixels.astype(int) - expected).max() <= (0 if extension == "png" else 1)


def test_unknown_and_ambiguous_views_are_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match=r"unknown view 'nope'; known are sRGB, .*Un-tone-mapped"):
        views.find("nope")
    with pytest.raises(ValueError, match=r"view 'a' may be any of .*Raw"):
        views.find("a")


@pytest.mark.parametrize("text", [None, "garbage", "ocio_profile_version: 99"])
def test_a_configuration_that_cannot_be_read_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str | None
) -> None:
    path = tmp_path / "broken.ocio"
    if text is not None:
        path.write_text(text)
    monkeypatch.setenv("OCIO", str(path))
    with pytest.raises(Error, match=r"cannot read the OCIO config .*broken\.ocio") as caught:
        views.encode(row(1), view="openColorIO")
    assert "\n" not in str(caught.value)


def test_a_configuration_without_a_known_space_is_an_error(
    own_config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own_config.with_name("other.ocio").write_text(CONFIG.replace("LIN_AP1", "secret"))
    monkeypatch.setenv("OCIO", str(own_config.with_name("other.ocio")))
    with pytest.raises(Error, match=r"no space for linear Rec\.709 or ACES"):
        views.encode(row(1), view="Dark")


def test_views_are_tried_before_anything_is_rendered(
    own_config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The stage does not exist, and it is the view that is complained about."""
    own_config.write_text(CONFIG.replace("LIN_AP1", "secret"))
    output = str(own_config.with_name("a.png"))
    for view, status, says in (("Dark", 1, "no space for"), ("nope", 2, "unknown view 'nope'")):
        assert main(["render", "none.usda", output, "--view", view]) == status
        said = capsys.readouterr().err
        assert says in said and len(said.splitlines()) == 1
