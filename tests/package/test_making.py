"""Pictures say how they were made, and `usdmlt render --from` makes them again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import usdmlt
from usdmlt import Image, making, read_image
from usdmlt.cli import main
from usdmlt.errors import Error

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"
QUICK = {"width": 24, "samples": 8, "depth": 4}


def same(a: Image, b: Image) -> bool:
    return list(a.channels) == list(b.channels) and all(
        np.array_equal(a[name], b[name], equal_nan=True) for name in a.channels
    )


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "flags",
    [
        ["-w", 24, "--samples", 8],
        ["--res", 30, 20, "--mutations", 12, "--seed", 7, "--integrator", "mlt"],
        ["-w", 24, "--samples", 8, "--crop", 0.2, 0.3, 0.7, 0.9, "--filter", "box"],
        ["-w", 24, "--samples", 8, "--colorSpace", "ACEScg", "--purposes", "render,proxy"],
        ["-w", 24, "--samples", 8, "--set", "/World/light.inputs:intensity=3", "--mask", "/World"],
        ["-w", 24, "--samples", 8, "--aov", "P,CryptoObject,primvars:st,mine=C<RD>.*[LOB]"],
        ["-w", 24, "--samples", 8, "-f", "1", "--double-sided", "auto", "--integrator", "bdpt"],
    ],
)
def test_a_picture_is_made_again_to_the_bit(
    here: Path, flags: list[object], capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(SCENE, "scene.usda")
    flags = [str(flag) for flag in flags]
    if "--set" in flags:
        flags[flags.index("--set") + 1] = f"{light()}=3"
    output = "a.####.exr" if "-f" in flags else "a.exr"
    assert main(["render", "scene.usda", output, "--depth", "5", *flags]) == 0
    first = next(here.glob("a*.exr"))
    assert main(["render", "--from", str(first), "b.exr", "--threads", "1"]) == 0
    a, b = read_image(first), read_image("b.exr")
    assert same(a, b), capsys.readouterr().err
    for name in ("frame", "seed", "samples", "mutations", "filter", "units", "data_window"):
        assert a.metadata.get(name) == b.metadata.get(name), name
    assert a.color_space == b.color_space


def light() -> str:
    """The path of the intensity of a light of the scene."""
    from pxr import Usd, UsdLux

    stage = Usd.Stage.Open(str(SCENE))
    found = next(prim for prim in stage.Traverse() if prim.HasAPI(UsdLux.LightAPI))
    return f"{found.GetPath()}.inputs:intensity"


def test_a_picture_that_a_time_limit_ended_is_made_again_without_the_clock(here: Path) -> None:
    main(["render", str(SCENE), "a.exr", "-w", "24", "--time", "0.3", "--depth", "4"])
    assert main(["render", "--from", "a.exr"]) == 0
    a, b = read_image("a.exr"), read_image("a_again.exr")
    assert a.metadata["units"] == b.metadata["units"] > 1
    assert same(a, b)


def test_flags_change_what_is_made_again(here: Path) -> None:
    usdmlt.render(SCENE, **QUICK, seed=3).write("a.exr")
    assert main(["render", "--from", "a.exr", "b.exr", "--samples", "4", "-w", "32"]) == 0
    made = read_image("b.exr")
    assert (made.width, made.metadata["samples"], made.metadata["seed"]) == (32, 4, 3)
    assert main(["render", "--from", "a.exr", "c.exr", "--mutations", "5"]) == 0
    assert read_image("c.exr").metadata["integrator"] == "mlt"


def test_a_changed_picture_that_a_time_limit_had_ended_gets_as_many_samples(here: Path) -> None:
    by = ["--integrator", "path", "--depth", "4"]
    main(["render", str(SCENE), "a.exr", "-w", "24", "--time", "0.3", *by])
    taken = read_image("a.exr").metadata["samples"]
    assert main(["render", "--from", "a.exr", "b.exr", "--res", "48", "20"]) == 0
    b = read_image("b.exr")
    assert (b.width, b.height) == (48, 20)
    assert b.metadata["samples"] == pytest.approx(taken, abs=1)
    assert main(["render", "--from", "b.exr", "c.exr", "-w", "16"]) == 0
    assert (read_image("c.exr").width, read_image("c.exr").height) == (16, 16)


def test_flags_that_turn_something_off_count_too(here: Path) -> None:
    (here / "dark.usda").write_text('#usda 1.0\ndef Sphere "ball" {\n}\n')
    usdmlt.render("dark.usda", **QUICK).write("a.exr")
    assert main(["render", "--from", "a.exr", "b.exr", "--disableCameraLight"]) == 0
    assert read_image("a.exr")["color"].max() > 0.1 and not read_image("b.exr")["color"].any()


def test_another_stage_may_be_rendered_in_the_same_way(here: Path) -> None:
    usdmlt.render(SCENE, **QUICK).write("a.exr")
    shutil.copy(SCENE, "moved.usda")
    assert main(["render", "--from", "a.exr", "moved.usda", "b.exr"]) == 0
    b = read_image("b.exr")
    assert same(read_image("a.exr"), b) and b.metadata["stage"] == str(here / "moved.usda")


def test_pictures_made_in_python_are_made_again(here: Path) -> None:
    usdmlt.render(SCENE, **QUICK, overrides={light(): "2"}, threads=1).write("a.exr")
    made = making.read_making("a.exr")
    assert made.options == {"width": 24, "overrides": {light(): "2"}}
    assert "threads" not in made.settings and "time" not in made.settings
    assert main(["render", "--from", "a.exr", "b.exr"]) == 0
    assert same(read_image("a.exr"), read_image("b.exr"))


def of_an_open_stage() -> None:
    from pxr import Usd

    usdmlt.render(Usd.Stage.Open(str(SCENE)), **QUICK).write("a.exr")


def of_another_renderer() -> None:
    Image.from_rgba(np.zeros((2, 2, 4)), metadata={"renderer": "other 1"}).write("a.exr")


def of_none() -> None:
    Image.from_rgba(np.zeros((2, 2, 4))).write("a.exr")


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (of_an_open_stage, "its stage was open in Python"),
        (of_another_renderer, "it was made by other 1"),
        (of_none, "it was not made by usdmlt"),
    ],
)
def test_a_picture_that_does_not_say_how_is_one_line(
    here: Path, make: Callable[[], None], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    make()
    capsys.readouterr()
    assert main(["render", "--from", "a.exr", "b.exr"]) == 1
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert f"a.exr does not say how to make it again: {reason}" in said


def made(**more: object) -> dict[str, object]:
    """What a file says, of another version."""
    done = {"units": 1, "samples_per_pixel": 8.0}
    return {"stage": "a", "options": {}, "settings": {}, "version": "9", **done, **more}


def test_damaged_settings_are_an_error_and_not_a_crash(here: Path) -> None:
    image = Image.from_rgba(np.zeros((2, 2, 4)), metadata={"renderer": "usdmlt 9"})
    whole = made()
    for damaged in ("{", [], {"stage": 1}, whole | {"settings": 3}, whole | {"more": 1}):
        text = damaged if isinstance(damaged, str) else json.dumps(damaged)
        image.metadata["settings"] = text
        image.write("a.exr")
        with pytest.raises(Error, match="does not say how to make it again"):
            making.read_making("a.exr")


def test_options_of_another_version_are_named(here: Path) -> None:
    metadata = {"renderer": "usdmlt 9", "settings": json.dumps(made(options={"fog": 1}))}
    Image.from_rgba(np.zeros((2, 2, 4)), metadata=metadata).write("a.exr")
    with pytest.raises(Error, match="made by usdmlt 9, with fog: unknown here"):
        making.read_making("a.exr")


def test_a_stage_that_is_gone_is_one_line(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(SCENE, "scene.usda")
    usdmlt.render("scene.usda", **QUICK).write("a.exr")
    Path("scene.usda").unlink()
    assert main(["render", "--from", "a.exr", "b.exr"]) == 1
    assert "scene.usda" in capsys.readouterr().err


@pytest.mark.parametrize("crop", [None, (0.25, 0.1, 0.85, 0.8)])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_positions_land_on_their_own_pixels_by_the_matrix_in_the_file(
    here: Path, crop: tuple[float, ...] | None, projection: str
) -> None:
    """Where the ray through the middle of a pixel hits, projected by what another reader reads."""
    body = """#usda 1.0
def Camera "main_cam" {{
    token projection = "{}"
    float focalLength = 30
    float horizontalAperture = 40
    float verticalAperture = 30
    double3 xformOp:translate = (1, 2, 9)
    float3 xformOp:rotateXYZ = (-8, 5, 20)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}}
def Sphere "ball" {{
    double radius = 6
}}
def DistantLight "sun" {{
}}
"""
    (here / "ball.usda").write_text(body.format(projection))
    usdmlt.render("ball.usda", width=40, crop=crop, samples=1, aovs=["P"]).write("a.exr")
    file = oiio.ImageInput.open("a.exr")
    spec, image = file.spec(), read_image("a.exr")
    to_ndc = np.array(spec.getattribute("worldToNDC")).reshape(4, 4)
    rows, columns = np.mgrid[0 : spec.height, 0 : spec.width]
    hit = np.isfinite(image["P"]).all(axis=-1) & (image["P"] != 0).any(axis=-1)
    assert hit.mean() > 0.4
    x, y, _, w = np.moveaxis(np.insert(image["P"][hit], 3, 1, axis=-1) @ to_ndc, -1, 0)
    np.testing.assert_allclose(x / w * spec.full_width, spec.x + columns[hit] + 0.5, atol=2e-3)
    np.testing.assert_allclose(y / w * spec.full_height, spec.y + rows[hit] + 0.5, atol=2e-3)


def test_anamorphic_pixels_and_the_frame_rate_are_told(here: Path) -> None:
    image = usdmlt.render(SCENE, **QUICK)
    assert image.metadata["pixel_aspect_ratio"] == 1
    assert image.metadata["frames_per_second"] == 24
    scene = usdmlt.load(SCENE, width=24)
    left, right, bottom, top = scene.camera.window
    scene.camera.window = 2 * left, 2 * right, bottom, top
    assert usdmlt.render(scene, samples=1).metadata["pixel_aspect_ratio"] == pytest.approx(2)
