"""Variants and attribute values that are asked for, search paths and resolver contexts."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd

from usdmlt.errors import Error
from usdmlt.stage import load

SIZES = """
def Xform "x" (
    variants = { string size = "big" }
    prepend variantSets = "size"
) {
    variantSet "size" = {
        "big" { def Cube "c" { double size = 4 } }
        "small" { def Cube "c" { double size = 1 } }
    }
}
"""
LIGHT = 'def SphereLight "l" { float inputs:intensity = 2\n color3f inputs:color = (1, 1, 1) }'


def side(scene) -> float:
    return float(np.ptp(scene.meshes[0].points, axis=0)[0])


def test_the_variant_asked_for_is_read(read):
    assert side(read(SIZES)) == 4
    assert side(read(SIZES, variants={"/x:size": "small"})) == 1


@pytest.mark.parametrize(
    ("variants", "kind", "says"),
    [
        ({"/x:size": "tiny"}, Error, "/x: no variant tiny of size; there are big, small"),
        ({"/x:shape": "a"}, Error, "/x: no variant set shape; there are size"),
        ({"/y:size": "big"}, Error, "/y: no such prim"),
        ({"/x": "big"}, ValueError, "is not /Prim:set=choice"),
    ],
)
def test_variants_that_are_not_there_are_named(read, variants, kind, says):
    with pytest.raises(kind, match=says):
        read(SIZES, variants=variants)


@pytest.mark.parametrize(
    ("target", "text", "radiance"),
    [
        ("/l.inputs:intensity", "3.5", (3.5, 3.5, 3.5)),
        ("/l.inputs:color", "(0.5, 1, 2)", (1.0, 2.0, 4.0)),
        ("/l.inputs:enableColorTemperature", "false", (2.0, 2.0, 2.0)),
    ],
)
def test_an_attribute_has_the_value_asked_for(read, target, text, radiance):
    assert read(LIGHT, overrides={target: text}).lights[0].radiance == pytest.approx(radiance)


def test_tokens_and_assets_need_no_quotes(read):
    body = 'def Cube "c" { uniform token purpose = "default" }'
    assert read(body, overrides={"/c.purpose": "guide"}).meshes == []
    assert read(body, overrides={"/c.purpose": '"guide"'}).meshes == []


def test_a_value_asked_for_holds_at_all_times(read):
    body = 'def Cube "c" { double size.timeSamples = { 1: 1, 2: 2 } }'
    assert side(read(body, frame=2, overrides={"/c.size": "5"})) == 5


@pytest.mark.parametrize(
    ("target", "text", "kind", "says"),
    [
        ("/l.inputs:intensity", "bright", ValueError, "'bright' is no value of type float"),
        ("/l.inputs:intensity", "1 } def X", ValueError, "is no value of type float"),
        ("/l.inputs:color", "(1, 2)", ValueError, "is no value of type color3f"),
        ("/l.nonsense", "1", Error, "/l: no attribute nonsense"),
        ("/m.intensity", "1", Error, "/m: no such prim"),
        ("/l", "1", ValueError, "is not /Prim.attribute"),
    ],
)
def test_values_that_cannot_be_are_named(read, target, text, kind, says):
    with pytest.raises(kind, match=says):
        read(LIGHT, overrides={target: text})


def test_what_is_inside_an_instance_cannot_be_edited(write):
    write('def Xform "p" { def Cube "c" {} }', 'defaultPrim = "p"', name="p.usda")
    stage = write('def "i" (instanceable = true\n prepend references = @p.usda@) {}')
    with pytest.raises(Error, match="/i/c: is inside an instance"):
        load(stage, overrides={"/i/c.size": "5"})


def test_an_open_stage_is_not_edited_and_its_session_still_counts(write):
    stage = Usd.Stage.Open(str(write(LIGHT + '\ndef Cube "c" {}')))
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.GetPrimAtPath("/c").GetAttribute("size").Set(6.0)
    scene = load(stage, overrides={"/l.inputs:intensity": "9"})
    assert scene.lights[0].radiance == (9.0, 9.0, 9.0)
    assert side(scene) == 6
    assert stage.GetPrimAtPath("/l").GetAttribute("inputs:intensity").Get() == 2


def test_the_start_time_of_a_session_layer_counts_with_edits_too(write):
    session = write("", "startTimeCode = 7", name="session.usda")
    body = 'def Cube "c" { double size.timeSamples = { 1: 1, 9: 9 } }\n' + LIGHT
    scene = load(write(body), session_layer=session, overrides={"/l.inputs:intensity": "9"})
    assert scene.metadata["frame"] == 7
    assert side(scene) == 7


def test_assets_are_found_in_search_paths(write, tmp_path):
    (tmp_path / "library").mkdir()
    write('def Cube "c" { double size = 3 }', 'defaultPrim = "c"', name="library/part.usda")
    stage = write('def "p" (references = @part.usda@) {}')
    assert load(stage).meshes == []
    assert side(load(stage, search_paths=[tmp_path / "library"])) == 3
    opened = Usd.Stage.Open(str(stage))
    assert side(load(opened, search_paths=[tmp_path / "library"])) == 3
    with pytest.raises(Error, match="no such folder to search"):
        load(stage, search_paths=[tmp_path / "none"])


def test_the_resolver_context_may_be_the_one_that_is_bound(write, tmp_path):
    """The stage's own folder is searched with "root" alone; "inherit" takes what is bound."""
    from pxr import Ar

    (tmp_path / "other").mkdir()
    write('def Cube "c" { double size = 3 }', 'defaultPrim = "c"', name="other/searched.usda")
    stage = write('def "p" (references = @searched.usda@) {}')
    bound = Ar.ResolverContext(Ar.DefaultResolverContext([str(tmp_path / "other")]))
    with Ar.ResolverContextBinder(bound):
        assert load(stage, resolver="root").meshes == []
        assert side(load(stage, resolver="inherit")) == 3


def test_the_default_time_has_no_time_samples(read):
    body = 'def Cube "c" { double size = 2\n double size.timeSamples = { 1: 1, 9: 9 } }'
    assert side(read(body)) == 1
    scene = read(body, frame="default")
    assert side(scene) == 2
    assert scene.metadata["frame"] is None
