"""Layers from the command line to the file, and what is said of those that there are not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt.cli import main

STAGE = """#usda 1.0
def Camera "camera"
{
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Cube "cube"
{
    color3f[] primvars:tint = [(0.25, 0.5, 0.75)]
}
def SphereLight "key"
{
    string primvars:usdmlt:lightGroup = "key"
    float inputs:intensity = 40
    double3 xformOp:translate = (3, 4, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky"
{
    float inputs:intensity = 0.2
}
def RenderSettings "settings"
{
    rel products = [</settings/product>]
    def RenderProduct "product"
    {
        token productName = "layered.exr"
        rel orderedVars = [</settings/Ci>, </settings/normals>, </settings/sun>]
    }
    def RenderVar "Ci"
    {
        string sourceName = "Ci"
    }
    def RenderVar "normals"
    {
        string sourceName = "N"
        token dataType = "float3"
    }
    def RenderVar "sun"
    {
        string sourceName = "C.*<L.'key'>"
        token sourceType = "lpe"
        token dataType = "color3h"
    }
}
"""


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("stage.usda").write_text(STAGE)
    return "stage.usda"


def render(stage: str, *arguments: str) -> int:
    return main(["render", "-q", stage, *arguments, "--imageWidth", "16", "--samples", "2"])


def channels_of(path: str) -> dict[str, str]:
    """Formats by channel."""
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(path)
    spec = file.spec()
    file.close()
    formats = spec.channelformats or [spec.format] * spec.nchannels
    return {name: str(kind) for name, kind in zip(spec.channelnames, formats, strict=True)}


def test_layers_are_written_as_the_flags_ask(stage):
    asked = ("albedo, P,Z", "primvars:tint", "lightGroups,caustics=LS+DE,C.{1,2}L")
    flags = [argument for names in asked for argument in ("--aov", names)]
    assert render(stage, "shot.exr", *flags, "--integrator", "bdpt") == 0
    channels = channels_of("shot.exr")
    assert channels.keys() >= {"R", "G", "B", "A", "Z", "P.X", "albedo.R", "primvars_tint.B"}
    assert channels["Z"] == channels["P.X"] == "float"
    assert channels["caustics.R"] == channels["C_1_2_L.G"] == channels["albedo.R"] == "half"
    image = usdmlt.read_image("shot.exr")
    groups = sum(image[f"lightGroup_{name}"] for name in ("key", "default"))
    np.testing.assert_allclose(groups, image["color"], rtol=2e-3, atol=1e-4)


def test_a_product_s_vars_are_in_its_file(stage):
    assert render(stage) == 0
    channels = channels_of("layered.exr")
    assert channels["N.X"] == "float" and channels["sun.R"] == "half"
    assert not {"normals.X", "Ci.R"} & channels.keys()
    assert render(stage, "other.exr", "--aov", "Z") == 0
    assert "Z" in channels_of("other.exr") and "N.X" not in channels_of("other.exr")


def test_cryptomatte_s_metadata_has_the_specification_s_names(stage):
    import OpenImageIO as oiio

    assert render(stage, "shot.exr", "--aov", "CryptoObject,objectId") == 0
    file = oiio.ImageInput.open("shot.exr")
    attributes = {a.name: a.value for a in file.spec().extra_attribs}
    file.close()
    assert attributes["cryptomatte/3ae39a5/name"] == "CryptoObject"
    assert attributes["cryptomatte/3ae39a5/hash"] == "MurmurHash3_32"
    assert attributes["cryptomatte/3ae39a5/conversion"] == "uint32_to_float32"
    assert set(json.loads(attributes["cryptomatte/3ae39a5/manifest"])) == {"/cube"}
    assert json.loads(attributes["usdmlt:objectIds"]) == {"/cube": 1}
    image = usdmlt.read_image("shot.exr")
    assert image["CryptoObject00"].shape == (image.height, image.width, 4)
    assert image.metadata["cryptomatte/3ae39a5/name"] == "CryptoObject"


def test_a_picture_made_again_has_the_same_layers(stage):
    flags = ("--aov", "N,primvars:tint,sun=C.*<L.'key'>,CryptoObject", "--integrator", "path")
    assert render(stage, "shot.exr", *flags) == 0
    assert main(["render", "-q", "--from", "shot.exr", "again.exr"]) == 0
    one, other = usdmlt.read_image("shot.exr"), usdmlt.read_image("again.exr")
    assert one.channels.keys() == other.channels.keys() >= {"N", "sun", "primvars_tint"}
    for name in one.channels:
        np.testing.assert_array_equal(one[name], other[name])


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("albedos", "unknown layer 'albedos': the layers are color, alpha"),
        ("C<RD", "light path expression 'C<RD', character 2: < is never closed"),
        ("N,albedo,N", "two layers of one name are asked for: N"),
        ("N,,albedo", "a layer is asked for by its name, not by ''"),
    ],
)
def test_what_is_no_layer_is_one_line_and_status_2(stage, capfd, asked, message):
    assert render(stage, "shot.exr", "--aov", asked) == 2
    said = capfd.readouterr().err.strip()
    assert message in said and "\n" not in said
    assert not Path("shot.exr").exists()


def test_layers_asked_for_of_a_picture_that_has_none_are_refused(stage, capfd):
    assert render(stage, "shot.png", "--aov", "N") == 2
    assert "--aov is of an .exr" in capfd.readouterr().err
    assert not Path("shot.png").exists()


def test_too_many_layers_of_paths_are_refused(stage, capfd):
    many = ",".join(f"l{i}=C.{{{i}}}L" for i in range(65))
    assert render(stage, "shot.exr", "--aov", many) == 2
    assert "at most 64 layers can be of light paths" in capfd.readouterr().err


def test_groups_and_primvars_that_nothing_has_are_warnings(stage, capfd):
    assert (
        main(["render", stage, "shot.exr", "-w", "8", "--aov", "lightGroup:kye,primvars:tinr"]) == 0
    )
    said = capfd.readouterr().err
    assert "no light is of the group or the path kye" in said
    assert "no surface has the primvar tinr" in said


def test_inspect_says_which_layers_the_stage_asks_for(stage, capsys):
    assert main(["inspect", stage]) == 0
    text = capsys.readouterr().out
    assert "layer N" in text and "layer sun: C.*<L.'key'>" in text
    assert main(["inspect", stage, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["layers"] == [["N", "N"], ["sun", "C.*<L.'key'>"]]
