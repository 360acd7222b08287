"""``doubleSided``, and who asks that it counts."""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import rgba
from support.usda import instance
from usdmlt.errors import Error
from usdmlt.stage import load

SAYS = "uniform bool doubleSided = true"


def sides(scene) -> dict[str, bool]:
    meshes = [*scene.meshes, *(m for p in scene.prototypes for m in p.meshes)]
    return {mesh.name: mesh.double_sided for mesh in meshes}


TWO = f'def Mesh "one" {{ QUAD }} def Mesh "both" {{ QUAD {SAYS} }}'


def settings(value: str) -> str:
    return f'def RenderSettings "settings" {{ token usdmlt:doubleSided = "{value}" }}'


@pytest.mark.parametrize(
    ("stage", "options", "expected"),
    [
        (TWO, {}, True),
        (TWO, {"double_sided": "on"}, True),
        (TWO, {"double_sided": "auto"}, False),
        (TWO + settings("auto"), {}, False),
        (TWO + settings("on"), {}, True),
        (TWO + settings("auto"), {"double_sided": "on"}, True),
        (TWO + settings("on"), {"double_sided": "auto"}, False),
    ],
)
def test_sides_count_where_that_is_asked_for(read, stage, options, expected):
    assert sides(read(stage, **options)) == {"/one": expected, "/both": True}


def test_other_words_are_an_error(read):
    with pytest.raises(ValueError, match="double_sided must be one of on, auto, not 'off'"):
        read(TWO, double_sided="off")
    with pytest.raises(Error, match="/settings: double_sided must be one of on, auto, not 'off'"):
        read(TWO + settings("off"))


@pytest.mark.parametrize("kind", ["Sphere", "Cube", "Cone", "Cylinder", "Capsule"])
@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_shapes_have_sides(read, kind, orientation):
    """The front is outside, and inside where the shape is left-handed."""
    body = f'def {kind} "g" {{ uniform token orientation = "{orientation}" }}'
    (mesh,) = read(body, double_sided="auto").meshes
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    volume = (a * np.cross(b, c)).sum() / 6
    assert not mesh.double_sided
    assert (volume > 0) == (orientation == "rightHanded")


def test_curves_have_no_sides(read):
    body = """def BasisCurves "c" { int[] curveVertexCounts = [2]
        point3f[] points = [(0, 0, 0), (1, 0, 0)]
        uniform token type = "linear" }"""
    assert sides(read(body, double_sided="auto")) == {"/c": True}


def surface(inputs: str) -> str:
    return f"""def Material "m" {{
        token outputs:surface.connect = </m/s.outputs:surface>
        def Shader "s" {{
            uniform token info:id = "UsdPreviewSurface"
            {inputs}
            token outputs:surface
        }}
    }}
    def Mesh "g" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        QUAD
        rel material:binding = </m>
    }}"""


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ("float inputs:opacity = 0.2", True),
        ("float inputs:opacity = 1", False),
        ("float inputs:opacity = 0.2\nfloat inputs:opacityThreshold = 0.5", False),
        ('float inputs:opacity = 0.2\ntoken inputs:opacityMode = "presence"', False),
    ],
)
def test_what_refracts_keeps_its_back(read, inputs, expected):
    assert sides(read(surface(inputs), double_sided="auto")) == {"/g": expected}


def test_prototypes_have_sides(read):
    body = f"""class "asset" {{ {TWO} }} {instance("i")} {instance("j")}"""
    assert sides(read(body, double_sided="auto")) == {"/i/one": False, "/i/both": True}


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("scale", ["(1, 1, 1)", "(-1, 1, 1)", "(1, -1, -1)"])
@pytest.mark.parametrize("behind", [False, True])
def test_a_quad_is_seen_from_its_front(write, orientation, scale, behind):
    """Its outside is +z where it is right-handed; a scale takes it along, mirroring or not."""
    stage = write(f"""def Mesh "g" {{ QUAD
        uniform token orientation = "{orientation}"
        float3 xformOp:scale = {scale}
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }}
    def Camera "c" {{
        float3 xformOp:rotateXYZ = (0, {180 if behind else 0}, 0)
        double3 xformOp:translate = (0, 0, 4)
        uniform token[] xformOpOrder = ["xformOp:rotateXYZ", "xformOp:translate"]
        token projection = "orthographic"
        float horizontalAperture = 30
        float verticalAperture = 30
    }}""")
    outside = 1 if orientation == "rightHanded" else -1
    if "-1)" in scale:
        outside = -outside
    seen = outside == (-1 if behind else 1)
    for option, covers in (("auto", seen), ("on", True)):
        scene = load(stage, double_sided=option, width=12, height=12)
        for integrator in ("path", "bdpt"):
            alpha = rgba(scene, integrator, samples=4, depth=2)[..., 3]
            assert (alpha.max() == 1) == covers, (option, integrator)
