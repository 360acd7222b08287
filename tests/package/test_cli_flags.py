"""Every flag of reading and writing does what it says, most of them as usdrecord's do."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from usdmlt import read_image
from usdmlt.cli import main

Call = Callable[..., "tuple[int, str, str]"]

BODY = """#usda 1.0
(
    startTimeCode = 1
)
def Scope "Render" {
    def RenderSettings "low" {
        uniform int2 resolution = (16, 8)
        uniform bool usdmlt:twoStage = 0
        int usdmlt:samples = 3
        rel products = </Render/beauty>
    }
    def RenderSettings "high" { uniform int2 resolution = (32, 16) }
    def RenderPass "pass" { rel renderSource = </Render/high> }
    def RenderProduct "beauty" {
        token productName.timeSamples = { 1: "one.exr", 2: "two.exr" }
    }
}
def Camera "main_cam" {
    float horizontalAperture = 20
    float verticalAperture = 10
    float focalLength = 10
    float4[] clippingPlanes = []
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "side_cam" {}
def Cube "cube" (
    variants = { string size = "small" }
    prepend variantSets = "size"
) {
    variantSet "size" = {
        "small" { double size = 1 }
        "large" { double size = 6 }
    }
}
def Cube "proxy" { uniform token purpose = "proxy"
    double3 xformOp:translate = (2, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Cube "moving" {
    double size = 0.5
    double3 xformOp:translate = (-3, 0, 0)
    double3 xformOp:translate.timeSamples = { 1: (-2, 0, 0), 2: (-2, 1, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def SphereLight "light" {
    float inputs:intensity = 40
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
QUICK = ("--samples", 1, "--integrator", "path", "-w", 16, "-q")


@pytest.fixture
def call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Call:
    """Run the command line on ``s.usda`` in ``tmp_path``: status, stdout, stderr."""
    (tmp_path / "s.usda").write_text(BODY.replace("{ def", "{\ndef").replace(" }\n", "\n}\n"))
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = int(end.code or 0)
        out, err = capsys.readouterr()
        return status, out, err

    return run


def inspected(call: Call, *flags: object) -> dict[str, object]:
    """What `inspect --json` says with these flags."""
    status, out, err = call("inspect", "s.usda", "--json", *flags)
    assert status == 0, err
    result: dict[str, object] = json.loads(out)
    return result


def covered(path: str = "a.exr") -> np.ndarray:
    return read_image(path)["alpha"]


def test_cameras_are_listed_and_nothing_is_rendered(call: Call) -> None:
    assert call("render", "s.usda", "--list-cameras")[:2] == (0, "/main_cam\n/side_cam\n")
    assert os.listdir() == ["s.usda"]


def test_camera_by_name(call: Call) -> None:
    assert inspected(call)["camera"] == "/main_cam"
    assert inspected(call, "-cam", "side_cam")["camera"] == "/side_cam"


def test_a_variant_is_chosen(call: Call) -> None:
    call("render", "s.usda", "a.exr", *QUICK)
    small = covered().sum()
    assert call("render", "s.usda", "a.exr", *QUICK, "--variant", "/cube:size=large")[0] == 0
    assert covered().sum() > 3 * small


def test_an_attribute_is_set(call: Call) -> None:
    call("render", "s.usda", "a.exr", *QUICK)
    before = read_image("a.exr")["color"]
    assert call("render", "s.usda", "a.exr", *QUICK, "--set", "/light.inputs:intensity=80")[0] == 0
    after = read_image("a.exr")["color"]
    assert before.max() > 0.01
    np.testing.assert_allclose(after, 2 * before, rtol=2e-3)


@pytest.mark.parametrize(
    ("flags", "status", "says"),
    [
        (["--set", "nonsense"], 2, "--set 'nonsense' is not /PRIM.ATTRIBUTE=VALUE"),
        (["--set", "/light.inputs:intensity=x"], 2, "'x' is no value of type float"),
        (["--set", "/light.none=1"], 1, "/light: no attribute none"),
        (["--variant", "/cube:size"], 2, "is not /PRIM:SET=CHOICE"),
        (["--variant", "/cube:size=huge"], 1, "no variant huge of size; there are large, small"),
        (["--crop", 0, 0, 0, 1], 2, "crop must have xmin < xmax"),
        (["--crop", 0, 0, 1], 2, "expected 4 arguments"),
        (["--complexity", "extreme"], 2, "argument --complexity/-c: invalid choice"),
        (["--double-sided", "off"], 2, "argument --double-sided: invalid choice"),
        (["--resolver", "leaf"], 2, "argument --resolver: invalid choice"),
        (["--texture-memory", 0], 2, "texture_memory must be positive"),
        (["--search-path", "none"], 1, "none: no such folder to search"),
        (["--purposes", "gide"], 2, "unknown purposes: gide"),
        (["--mask", "cube"], 2, "not an absolute prim path"),
        (["--sessionLayer", "none.usda"], 1, "none.usda: no such file"),
        (["-rs", "/Render/none"], 1, "no such RenderSettings; there are /Render/low, /Render/high"),
        (["-rp", "/Render/none"], 1, "no such RenderPass; there are /Render/pass"),
        (["-rs", "/Render/low", "-rp", "/Render/pass"], 2, "not allowed with argument"),
        (["-d", "-f", "1"], 2, "not allowed with argument"),
        (["-color", "aces"], 2, "invalid choice"),
        (["--view", "ACES"], 2, "--view is of a .png or .jpg"),
        (["--view", "ACES", "-color", "disabled"], 2, "not allowed with argument"),
        (["--compression", "gzip"], 2, "compression must be one of none, rle, zip"),
        (["--compression", "dwaa:x"], 2, "its level is a whole number"),
        (["--compression", "b44", "--aov", "CryptoObject"], 2, "b44 would break CryptoObject"),
        (["--pixel-type", "double"], 2, "invalid choice"),
        (["--snapshot", 0], 2, "--snapshot 0 is no time between pictures"),
        (["--display", "here:there"], 2, "'here:there' is not HOST:PORT"),
        (["--display", "localhost:1"], 1, "cannot connect to the display localhost:1"),
        (["--progress", "loud"], 2, "invalid choice"),
        (["--from", "none.exr"], 1, "cannot read none.exr"),
        (["--from", "s.usda"], 1, "cannot read s.usda"),
        (["--renderer", "Storm"], 2, "invalid choice"),
        (["--colorSpace", "sRGB"], 2, "sRGB"),
        (["--traceToFile", "none/t.json"], 1, "cannot write none/t.json"),
    ],
)
def test_what_cannot_be_is_one_line(
    call: Call, flags: list[object], status: int, says: str
) -> None:
    got, out, err = call("render", "s.usda", "a.exr", *flags)
    assert (got, out, len(err.splitlines())) == (status, "", 1), err
    assert says in err
    assert not Path("a.exr").exists()


def test_a_crop_is_its_part_of_the_picture(call: Call) -> None:
    """Its data window is at the right place of the whole, and shows the same."""
    flags = ("--samples", 64, "--integrator", "path", "-q", "--filter", "box")
    call("render", "s.usda", "whole.exr", *flags, "-w", 32)
    call("render", "s.usda", "part.exr", *flags, "-w", 32, "--crop", 0.25, 0.5, 0.75, 1)
    spec = oiio.ImageInput.open("part.exr").spec()
    assert (spec.x, spec.y, spec.width, spec.height) == (8, 0, 16, 8)
    assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, 32, 16)
    whole = oiio.ImageInput.open("whole.exr").spec()
    to_ndc = [spec.getattribute("worldToNDC"), whole.getattribute("worldToNDC")]
    np.testing.assert_allclose(*to_ndc, atol=1e-6)
    part, seen = covered("part.exr"), covered("whole.exr")[:8, 8:24]
    assert 0.05 < seen.mean() < 0.9
    assert np.abs(part - seen).max() < 0.4  # 64 samples at an edge: six standard errors
    assert abs(part.mean() - seen.mean()) < 0.01


def test_frames_that_are_there_are_skipped(call: Call) -> None:
    Path("a.1.exr").write_bytes(b"kept")
    status, _, err = call(
        "render", "s.usda", "a.#.exr", "-f", "1:2", "--skip-existing", *QUICK[:-1]
    )
    assert status == 0
    assert "a.1.exr is there already: left out" in err
    assert Path("a.1.exr").read_bytes() == b"kept"
    assert covered("a.2.exr").shape == (8, 16)


def test_the_default_time_and_frames(call: Call) -> None:
    """The moving cube is left of the middle at x = -3, -2 and -2, and at frame 2 further up."""
    rows = {}
    for name, flags in (("d", ["-d"]), ("1", []), ("2", ["-f", "2"])):
        output = "a.#.exr" if "-f" in flags else "a.exr"
        call("render", "s.usda", output, *QUICK[:-3], "-q", "-w", 64, *flags, "--samples", 4)
        left = covered(output.replace("#", name))[:, :24]
        rows[name] = tuple(np.argwhere(left > 0.5).mean(axis=0).round())
    assert rows["d"][1] < rows["1"][1] == rows["2"][1]
    assert rows["2"][0] < rows["1"][0] == rows["d"][0]


def test_render_settings_and_passes_are_chosen(call: Call) -> None:
    assert inspected(call)["width"] == 16
    assert inspected(call, "-rs", "/Render/high")["width"] == 32
    assert inspected(call, "-rp", "/Render/pass")["width"] == 32


def test_flags_go_before_what_the_stage_asks_for(call: Call) -> None:
    _, _, err = call("render", "s.usda", "a.exr", "--integrator", "path")
    assert "3 samples per pixel" in err
    _, _, err = call("render", "s.usda", "a.exr", "--integrator", "path", "--samples", 2)
    assert "2 samples per pixel" in err


def test_without_output_the_products_are_rendered(call: Call) -> None:
    status, _, err = call("render", "s.usda", "-q", "-f", "1:2")
    assert status == 0, err
    assert sorted(os.listdir()) == ["one.exr", "s.usda", "two.exr"]
    assert covered("one.exr").shape == (8, 16)


def test_products_that_would_overwrite_each_other_are_an_error(call: Call) -> None:
    status, _, err = call("render", "s.usda", "-f", "2:4")
    assert (status, len(err.splitlines())) == (1, 1)
    assert "several pictures would be written to two.exr" in err


def test_without_output_and_products_there_is_nothing_to_do(call: Call) -> None:
    status, _, err = call("render", "s.usda", "-rs", "/Render/high")
    assert (status, len(err.splitlines())) == (2, 1)
    assert "name the OUTPUT" in err


def test_purposes_and_masks(call: Call) -> None:
    assert inspected(call)["meshes"] == 2
    assert inspected(call, "--purposes", "proxy")["meshes"] == 3
    assert inspected(call, "--mask", "/cube,/light")["meshes"] == 1


def test_a_session_layer_is_stronger(call: Call) -> None:
    Path("session.usda").write_text('#usda 1.0\nover "proxy" (active = false) {}\n')
    flags = ("--purposes", "proxy", "--sessionLayer", "session.usda")
    assert inspected(call, *flags)["meshes"] == 2


def test_assets_are_searched_for(call: Call) -> None:
    Path("library").mkdir()
    Path("library/part.usda").write_text('#usda 1.0\ndef Cube "part" {}\n')
    with open("s.usda", "a") as stage:
        stage.write('def "found" (references = @part.usda@</part>) {}\n')
    assert inspected(call)["meshes"] == 2
    assert inspected(call, "--search-path", "library")["meshes"] == 3
    assert inspected(call, "--resolver", "inherit", "--search-path", "library")["meshes"] == 3


def test_without_camera_light_a_dark_stage_is_black(call: Call) -> None:
    dark = ("--mask", "/cube,/main_cam,/Render", "--set", "/cube.size=6")
    call("render", "s.usda", "a.exr", *QUICK, *dark)
    assert read_image("a.exr")["color"].max() > 0.1
    assert call("render", "s.usda", "a.exr", *QUICK, *dark, "--disableCameraLight")[0] == 0
    image = read_image("a.exr")
    assert image["color"].max() == 0
    assert image["alpha"].max() == 1


def test_the_camera_sees_domes_or_not(call: Call) -> None:
    with open("s.usda", "a") as stage:
        stage.write('def DomeLight "dome" {}\n')
    call("render", "s.usda", "seen.exr", *QUICK)
    call("render", "s.usda", "again.exr", *QUICK, "--enableDomeLightVisibility")
    call("render", "s.usda", "unseen.exr", *QUICK, "--disableDomeLightVisibility")
    seen, unseen = read_image("seen.exr"), read_image("unseen.exr")
    np.testing.assert_array_equal(seen["color"], read_image("again.exr")["color"])
    outside, inside = seen["alpha"] == 0, seen["alpha"] == 1
    assert (seen["color"][outside] == 1).all()
    assert (unseen["color"][outside] == 0).all()
    np.testing.assert_array_equal(seen["color"][inside], unseen["color"][inside])  # lit by it


def test_a_png_is_srgb_or_linear(call: Call) -> None:
    call("render", "s.usda", "a.exr", *QUICK)
    call("render", "s.usda", "srgb.png", *QUICK)
    call("render", "s.usda", "linear.png", *QUICK, "-color", "disabled")
    color = np.clip(read_image("a.exr")["color"], 0, 1)
    linear, srgb = (
        np.asarray(oiio.ImageInput.open(name).read_image("uint8"), float)
        for name in ("linear.png", "srgb.png")
    )
    np.testing.assert_allclose(linear / 255, color, atol=3e-3)
    encoded = np.where(color < 0.0031308, 12.92 * color, 1.055 * color ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(srgb / 255, encoded, atol=3e-3)


def test_textures_are_kept_within_a_limit(call: Call) -> None:
    oiio.ImageBuf(oiio.ImageSpec(256, 128, 3, "float")).write("sky.exr")
    with open("s.usda", "a") as stage:
        stage.write('def DomeLight "dome" { asset inputs:texture:file = @sky.exr@\n }\n')
    assert inspected(call)["texture_bytes"] > 2**18
    assert inspected(call, "--texture-memory", 0.125)["texture_bytes"] <= 2**17


@pytest.mark.parametrize("form", ["chrome", "trace"])
def test_what_usd_did_is_traced(call: Call, form: str) -> None:
    flags = ("--traceToFile", "trace.out", "--traceFormat", form)
    assert call("render", "s.usda", "a.exr", *QUICK, *flags)[0] == 0
    text = Path("trace.out").read_text()
    assert "Usd" in text
    assert (form == "chrome") == text.lstrip().startswith("{")


def test_memory_is_told(call: Call) -> None:
    """4 points of 12 bytes, 2 triangles of 12, and the transform; what is shared counts once."""
    from usdmlt import scene as s
    from usdmlt.cli.memory import array_bytes, peak_memory

    quad = s.Mesh(np.zeros((4, 3), np.float32), np.zeros((2, 3), np.int32))
    matrix = quad.transform.nbytes
    assert array_bytes([quad, quad]) == 4 * 12 + 2 * 12 + matrix
    pixels = np.zeros((2**9, 2**9, 4), np.uint8)
    textures = [s.Texture(pixels), s.Texture(pixels, "clamp")]
    assert array_bytes(textures) == 2**20

    quick = [flag for flag in QUICK if flag != "-q"]
    status, _, told = call("render", "s.usda", "a.exr", *quick, "--memstats")
    assert status == 0
    (line,) = [line for line in told.splitlines() if line.startswith("memory: ")]
    names = [part.split()[0] for part in line.removeprefix("memory: ").split(", ")]
    assert names == ["geometry", "instances", "textures"]
    peak = float(line.split()[-2]) * 2**20
    assert 0.5 * peak_memory() < peak <= 1.001 * peak_memory()


def test_complexity_is_how_finely_surfaces_are_subdivided(call: Call) -> None:
    with open("s.usda", "a") as stage:
        stage.write("""def Mesh "m" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
}
""")
    counts = [inspected(call, "-c", level)["triangles"] for level in ("low", "medium", "veryhigh")]
    assert counts == sorted(counts) and len(set(counts)) == 3


def test_sides_count_where_that_is_asked_for(call: Call) -> None:
    """The camera is inside of a cube without doubleSided."""
    flags = ("--set", "/cube.size=20")
    assert call("render", "s.usda", "on.exr", *QUICK, *flags)[0] == 0
    assert call("render", "s.usda", "auto.exr", *QUICK, *flags, "--double-sided", "auto")[0] == 0
    assert (read_image("on.exr")["alpha"] == 1).all()
    assert read_image("auto.exr")["alpha"].mean() < 0.5


def test_models_are_drawn_as_they_ask_for_or_not(call: Call) -> None:
    with open("s.usda", "a") as stage:
        stage.write("""def Xform "model" (
    kind = "component"
    prepend apiSchemas = ["GeomModelAPI"]
) {
    uniform token model:drawMode = "cards"
    float3[] extentsHint = [(-1, -1, -1), (1, 1, 1)]
    def Sphere "ball" {}
}
""")
    drawn, whole = inspected(call), inspected(call, "--disableDrawMode")
    assert drawn["triangles"] < whole["triangles"]  # cards, and a sphere


def test_flags_of_usdrecord_without_effect_are_accepted(call: Call) -> None:
    flags = ("--disableGpu", "-r", "usdmlt")
    assert call("render", "s.usda", "a.exr", *QUICK, *flags)[0] == 0


def test_render_takes_the_same_options_and_what_the_stage_asks_for(call: Call) -> None:
    """Its settings say 3 samples and 16 pixels; arguments go before them."""
    import usdmlt

    image = usdmlt.render("s.usda", integrator="path")
    assert (image.width, image.stats["samples_per_pixel"]) == (16, 3)
    assert image.stats["settings"]["two_stage"] is False
    options = {"variants": {"/cube:size": "large"}, "render_settings": "/Render/high"}
    image = usdmlt.render("s.usda", integrator="path", samples=1, depth=2, **options)
    assert (image.width, image.stats["samples_per_pixel"]) == (32, 1)
    assert image["alpha"].mean() > 0.9
    with pytest.raises(TypeError, match="sampels"):
        usdmlt.render("s.usda", sampels=3)
