"""How layers are asked for, and what they are called in a file."""

from __future__ import annotations

import numpy as np
import pytest

from usdmlt import layers


def test_channels_are_named_as_compositors_know_them():
    channels = {name: layer.channels for name, layer in layers.KNOWN.items()}
    assert channels["color"] == ("R", "G", "B")
    assert channels["Z"] == ("Z",)
    assert channels["N"] == ("N.X", "N.Y", "N.Z")
    assert channels["albedo"] == ("albedo.R", "albedo.G", "albedo.B")
    assert channels["motionvector"] == ("motionvector.X", "motionvector.Y")
    assert channels["objectId"] == ("objectId",)
    assert channels["error"] == ("error.Y",)
    assert layers.parse("primvars:my:st").channels == ("primvars_my_st.Y",)
    assert layers.parse("LS+DE").channels == ("LS_DE.R", "LS_DE.G", "LS_DE.B")


def test_only_what_half_floats_hold_may_be_half():
    assert {name for name, layer in layers.KNOWN.items() if layer.half} == {
        *("color", "alpha", "albedo", "N", "Ng", "lightGroups", "emission", "direct", "indirect"),
        *("diffuse", "specular", "transmission", "caustics"),
    }
    assert layers.KNOWN["objectId"].dtype == np.uint32


def test_commas_separate_layers_but_not_inside_of_expressions():
    asked = "albedo, N,C.{1,2}L,C<L.'a,b'>,caustics=LS+DE"
    assert layers.split(asked) == ["albedo", "N", "C.{1,2}L", "C<L.'a,b'>", "caustics=LS+DE"]


def test_an_expression_can_have_a_name():
    layer = layers.parse("key=C.*<L.'key'>")
    assert (layer.name, layer.shows, layer.source) == ("key", "C.*<L.'key'>", "paths")
    assert layers.parse("lightGroup:key").shows == "C.*<[LOB].'key'>"


def test_other_renderers_names_are_known():
    assert layers.parse("depth") is layers.KNOWN["Z"]
    assert layers.resolve(["beauty", "st", "A"]) == (layers.KNOWN["uv"],)
    assert layers.resolve("beauty,st,A") == (layers.KNOWN["uv"],)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["albedos"], "unknown layer 'albedos': the layers are color, alpha"),
        (["Color"], "unknown layer 'Color'"),
        ([""], "by its name"),
        ([3], "by its name, not by 3"),
        (["my caustics=LS+DE"], "'my caustics' in 'my caustics=LS\\+DE' is no name"),
        (["caustics=LS+D"], "character 1: it has to begin with C"),
        (["primvars:"], "name of a primvar"),
        (["lightGroup:"], "no name of a light group"),
        (["N", "N"], "two layers of one name are asked for: N"),
        (["N", "normal"], "two layers of one name are asked for: N"),
        (["CD+L", "CD*L"], "two layers of one name are asked for: CD\\+L, CD\\*L"),
    ],
)
def test_what_is_no_layer_is_refused_in_one_line(asked, message):
    with pytest.raises(ValueError, match=message) as caught:
        layers.resolve(asked)
    assert "\n" not in str(caught.value)


def test_arrays_without_a_description_are_told_by_their_shape():
    assert layers.of("N", np.zeros((2, 2, 3), np.float32)) is layers.KNOWN["N"]
    kinds = [layers.of("x", np.zeros((2, 2, n), np.float32)).kind for n in (2, 3, 4)]
    assert kinds == ["vector2", "color", "rgba"]
    assert layers.of("x", np.zeros((2, 2), np.uint32)).kind == "id"
    assert layers.of("x", np.zeros((2, 2), np.float32)).channels == ("x.Y",)


def test_three_numbers_are_a_colour_or_a_vector():
    assert layers.of_width(layers.primvar("tint"), 3, True).channels[0].endswith(".R")
    assert layers.of_width(layers.primvar("velocity"), 3, False).channels[0].endswith(".X")
    assert layers.of_width(layers.primvar("st"), 2, False).kind == "vector2"
