"""Whatever a stage holds, it renders to finite numbers or is refused by one line.

Stages are made from the schemas themselves: prims of every type that is read, and some that are
not, in a random tree; any of their attributes set to a value of its type, sensible or not, now
and then to one of another type, arrays of lengths that need not fit, relationships to any prim. A
crash would end the test process.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt

import usdmlt

GEOMETRY = ["Mesh", "Sphere", "Cube", "Cone", "Cylinder", "Cylinder_1", "Capsule", "Capsule_1",
            "Plane", "BasisCurves", "HermiteCurves", "NurbsCurves", "Points", "NurbsPatch",
            "TetMesh", "PointInstancer", "GeomSubset", "SkelRoot", "Skeleton",
            "Volume"]  # fmt: skip
LIGHTS = ["SphereLight", "RectLight", "DiskLight", "CylinderLight", "DistantLight", "DomeLight",
          "DomeLight_1", "PortalLight"]  # fmt: skip
OTHERS = ["Xform", "Scope", "Camera", "Material", "Shader", "RenderSettings", "RenderProduct",
          "RenderVar", "RenderPass", ""]  # fmt: skip
APIS = ["MaterialBindingAPI", "ShapingAPI", "ShadowAPI", "MeshLightAPI", "SkelBindingAPI",
        "GeomModelAPI", "MotionAPI", "VisibilityAPI", "NoSuchAPI"]  # fmt: skip
SHADERS = ["UsdPreviewSurface", "UsdUVTexture", "UsdPrimvarReader_float2", "UsdTransform2d",
           "ND_standard_surface_surfaceshader", "ND_open_pbr_surface_surfaceshader",
           "ND_multiply_color3", "ND_image_color3", "ND_no_such_node"]  # fmt: skip
SHADER_INPUTS = {
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "base_color": Sdf.ValueTypeNames.Color3f,
    "roughness": Sdf.ValueTypeNames.Float,
    "metallic": Sdf.ValueTypeNames.Float,
    "opacity": Sdf.ValueTypeNames.Float,
    "ior": Sdf.ValueTypeNames.Float,
    "file": Sdf.ValueTypeNames.Asset,
    "st": Sdf.ValueTypeNames.Float2,
    "in1": Sdf.ValueTypeNames.Color3f,
    "varname": Sdf.ValueTypeNames.String,
    "displacement": Sdf.ValueTypeNames.Float,
}

ODD = [0.0, -1.0, 1e-30, 1e30, -1e30, 65504.0, float("inf"), float("nan")]
reals = st.one_of(st.floats(-4, 4, width=16), st.floats(-4, 4, width=16), st.sampled_from(ODD))
integers = st.one_of(st.integers(0, 8), st.sampled_from([-1, 3, 4, 1000, 2**31 - 1, -(2**31)]))
words = st.sampled_from(["", "none", "st", "normals", "é", "vertex", "linear", "sRGB"])
rotations = st.builds(Gf.Quatf, reals, reals, reals, reals)


def tuples(kind: type, size: int) -> st.SearchStrategy:
    return st.lists(reals, min_size=size, max_size=size).map(lambda v: kind(*v))


SCALARS: dict[str, st.SearchStrategy] = {
    "bool": st.booleans(),
    "int": integers,
    "int64": integers,
    "half": reals,
    "float": reals,
    "double": reals,
    "token": words,
    "string": words,
    "asset": st.sampled_from(["", "missing.png", "missing.<UDIM>.exr", "a.ies"]).map(Sdf.AssetPath),
    "quath": rotations.map(Gf.Quath),
    "quatf": rotations,
    "matrix4d": tuples(Gf.Matrix4d, 16),
    **{f"{n}{size}{c}": tuples(getattr(Gf, f"Vec{size}{c}"), size)
       for size in (2, 3, 4) for c in "hfd" for n in ("float", "point", "normal", "vector", "color",
                                                      "texCoord", "half", "double")},
    "float2": tuples(Gf.Vec2f, 2),
    "float3": tuples(Gf.Vec3f, 3),
    "float4": tuples(Gf.Vec4f, 4),
    "double2": tuples(Gf.Vec2d, 2),
    "double3": tuples(Gf.Vec3d, 3),
    "int2": st.tuples(integers, integers).map(lambda v: Gf.Vec2i(*v)),
}  # fmt: skip


def values(attribute: Usd.Attribute) -> st.SearchStrategy | None:
    """Of the attribute's type; None where the type is none of ours."""
    name = str(attribute.GetTypeName())
    allowed = attribute.GetMetadata("allowedTokens")
    one = SCALARS.get(name.removesuffix("[]"))
    if allowed and name.startswith("token"):
        one = st.one_of(st.sampled_from(list(allowed)), words)
    if one is None or not name.endswith("[]"):
        return one
    return st.lists(one, max_size=9)


def quad(mesh: UsdGeom.Mesh) -> None:
    mesh.CreatePointsAttr([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])


PLACES = [
    Gf.Matrix4d(1.0),
    Gf.Matrix4d().SetTranslate((1, -2, 0.5)),
    Gf.Matrix4d().SetRotate(Gf.Rotation((0, 1, 1), 100)),
    Gf.Matrix4d().SetScale((2, 1, -0.5)),
]


def mistype(draw: Callable[[st.SearchStrategy], Any], stage: Usd.Stage, path: Sdf.Path) -> None:
    """Author a value of any type, which a layer may hold whatever the schema says."""
    name = draw(
        st.sampled_from(["int", "string", "token", "asset", "double3", "quatf", "matrix4d"])
    )
    value, is_array = draw(SCALARS[name]), draw(st.booleans())
    typed = Sdf.ValueTypeNames.Find(name + "[]" * is_array)
    prim = stage.GetRootLayer().GetPrimAtPath(path.GetPrimPath())
    if path.name in prim.properties:
        return
    attribute = Sdf.AttributeSpec(prim, path.name, typed)
    attribute.default = type(typed.defaultValue)([value]) if is_array else value


def add_prim(draw: Callable[[st.SearchStrategy], Any], stage: Usd.Stage, paths: list[str]) -> None:
    parent = draw(st.sampled_from(["", *paths]))
    path = f"{parent}/P{len(paths)}"
    kind = draw(st.sampled_from(GEOMETRY) | st.sampled_from(LIGHTS) | st.sampled_from(OTHERS))
    prim = stage.DefinePrim(path, kind)
    paths.append(path)
    if kind == "Mesh" and draw(st.booleans()):
        quad(UsdGeom.Mesh(prim))
    for api in draw(st.lists(st.sampled_from(APIS), max_size=2, unique=True)):
        prim.AddAppliedSchema(api)
    if kind == "Shader":
        prim.CreateAttribute("info:id", Sdf.ValueTypeNames.Token).Set(
            draw(st.sampled_from(SHADERS))
        )
        for name in draw(st.lists(st.sampled_from(sorted(SHADER_INPUTS)), max_size=3, unique=True)):
            prim.CreateAttribute(f"inputs:{name}", SHADER_INPUTS[name])
    attributes = prim.GetAttributes()
    for index in draw(st.lists(st.integers(0, max(len(attributes) - 1, 0)), max_size=6)):
        if not attributes:
            break
        attribute = attributes[index]
        if draw(st.integers(0, 4)) == 0:
            mistype(draw, stage, attribute.GetPath())
            continue
        strategy = values(attribute)
        if strategy is None:
            continue
        value = draw(strategy)
        time = draw(st.sampled_from([Usd.TimeCode.Default(), Usd.TimeCode(0), Usd.TimeCode(1)]))
        with contextlib.suppress(Tf.ErrorException):  # uniform, or of a type of its own
            attribute.Set(value, time)
    if draw(st.booleans()):
        name = draw(st.sampled_from(["displayColor", "displayOpacity", "st", "normals"]))
        primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            name,
            Sdf.ValueTypeNames.FloatArray
            if name == "displayOpacity"
            else Sdf.ValueTypeNames.Float3Array,
            draw(st.sampled_from(["constant", "uniform", "varying", "vertex", "faceVarying"])),
        )
        one = reals if name == "displayOpacity" else tuples(Gf.Vec3f, 3)
        primvar.Set(draw(st.lists(one, max_size=5)))
        if draw(st.booleans()):
            primvar.SetIndices(Vt.IntArray(draw(st.lists(integers, max_size=5))))
    if draw(st.booleans()) and prim.IsA(UsdGeom.Xformable):
        with contextlib.suppress(Tf.ErrorException):
            transform = UsdGeom.Xformable(prim).AddTransformOp()
            for time in draw(st.sampled_from([[Usd.TimeCode.Default()], [0.0, 1.0]])):
                transform.Set(draw(st.sampled_from(PLACES) | tuples(Gf.Matrix4d, 16)), time)


def relate(draw: Callable[[st.SearchStrategy], Any], stage: Usd.Stage, paths: list[str]) -> None:
    source = stage.GetPrimAtPath(draw(st.sampled_from(paths)))
    if not source:  # lost in a cycle of references
        return
    names = [r.GetName() for r in source.GetRelationships()] + ["material:binding"]
    target = draw(st.sampled_from([*paths, "/Missing"]))
    kind = draw(st.sampled_from(["relationship", "connection", "reference"]))
    if kind == "relationship":
        source.CreateRelationship(draw(st.sampled_from(names))).AddTarget(target)
    elif kind == "reference":
        with contextlib.suppress(Tf.ErrorException):
            source.GetReferences().AddInternalReference(target)
        source.SetInstanceable(draw(st.booleans()))
    else:
        outputs = [a for a in source.GetAttributes() if a.GetName().startswith(("inp", "outp"))]
        if outputs:
            with contextlib.suppress(Tf.ErrorException):
                draw(st.sampled_from(outputs)).AddConnection(f"{target}.outputs:surface")


@st.composite
def stages(draw: Callable[[st.SearchStrategy], Any]) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    paths: list[str] = []
    for _ in range(draw(st.integers(1, 7))):
        add_prim(draw, stage, paths)
    for _ in range(draw(st.integers(0, 4))):
        relate(draw, stage, paths)
    if draw(st.booleans()):  # things move
        camera = UsdGeom.Camera.Define(stage, "/main_cam")
        camera.CreateShutterCloseAttr(1.0)
        camera.AddTranslateOp().Set((0, 0, 5))
        stage.SetStartTimeCode(0)
    return stage


def require_picture_or_refusal(stage: Usd.Stage) -> None:
    try:
        image = usdmlt.render(
            stage, width=8, height=8, samples=1, depth=3, threads=1, integrator="path"
        )
    except usdmlt.Error as error:
        refusal = str(error)
    else:
        refusal = ""
        assert np.isfinite(image["color"]).all()
    assert "\n" not in refusal


COMMON: dict[str, Any] = {
    "deadline": None,
    "database": None,
    "derandomize": True,
    "phases": [Phase.generate],
    "suppress_health_check": list(HealthCheck),
}


@settings(max_examples=100, **COMMON)
@given(stages())
def test_a_random_stage_is_rendered_or_refused(stage: Usd.Stage) -> None:
    require_picture_or_refusal(stage)


@pytest.mark.slow
@settings(max_examples=5000, **COMMON)
@given(stages())
def test_so_are_thousands(stage: Usd.Stage) -> None:
    require_picture_or_refusal(stage)
