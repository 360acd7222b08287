"""Pictures in a notebook, as IPython's own shell captures them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import usdmlt
from usdmlt import Error, Image, previews, views
from usdmlt.notebook import Live

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"


def pixels(png: bytes, folder: Path) -> np.ndarray:
    (folder / "shown.png").write_bytes(png)
    return oiio.ImageInput.open(str(folder / "shown.png")).read_image("uint8")


@pytest.fixture
def shell() -> Any:
    pytest.importorskip("IPython", reason="IPython is not installed")
    from IPython.core.interactiveshell import InteractiveShell

    yield InteractiveShell.instance()
    InteractiveShell.clear_instance()


def test_a_picture_shows_itself_as_the_srgb_view(tmp_path: Path, shell: Any) -> None:
    rng = np.random.default_rng(1)
    image = Image.from_rgba(rng.random((6, 9, 4)), color_space="lin_ap1_scene")
    data, _ = shell.display_formatter.format(image)
    expected = views.encode(image["color"], "lin_ap1_scene")
    np.testing.assert_array_equal(pixels(data["image/png"], tmp_path), expected)


def test_a_render_updates_one_output_until_it_is_done(
    tmp_path: Path, shell: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from IPython.utils.capture import capture_output

    monkeypatch.setattr(previews, "FIRST_SECONDS", 0.0)
    with capture_output() as captured:
        image = usdmlt.render(
            SCENE, width=32, integrator="path", samples=3000, depth=4,
            preview=Live(), preview_seconds=0.01,
        )  # fmt: skip
    outputs = captured.outputs
    assert len(outputs) >= 3
    assert [output.update for output in outputs] == [False] + [True] * (len(outputs) - 1)
    assert len({output.transient["display_id"] for output in outputs}) == 1
    shown = [pixels(output.data["image/png"], tmp_path) for output in outputs]
    np.testing.assert_array_equal(shown[-1], views.encode(image["color"]))
    assert (shown[0] != shown[-1]).any()
    assert outputs[-1].data["text/plain"] == "32x32, 3000 samples per pixel"


def test_without_ipython_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "IPython.display", None)
    with pytest.raises(Error, match=r"need IPython: pip install 'usdmlt\[notebook\]'"):
        Live()
