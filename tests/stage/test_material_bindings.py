"""Which material a mesh has: strengths, collections, purposes, subsets, and render contexts."""

from __future__ import annotations

import pytest

from usdmlt.scene import Dielectric, Diffuse, Layer, PreviewSurface

NAMES = ("A", "B", "C")
LOOKS = "".join(
    f"""def Material "{name}" {{ token outputs:surface.connect = </{name}/s.outputs:surface>
        def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
            token outputs:surface }} }}
    """
    for name in NAMES
)
API = '( prepend apiSchemas = ["MaterialBindingAPI"] )'
STRONG = '( bindMaterialAs = "strongerThanDescendants" )'
WEAK = '( bindMaterialAs = "weakerThanDescendants" )'


@pytest.fixture
def bound(read):
    """The name of each mesh's material, "" for the fallback."""

    def read_bound(body: str, metadata: str = "", **options: object) -> dict[str, str]:
        scene = read(LOOKS + body, metadata, **options)
        names = {mesh.name: scene.materials[mesh.materials].name for mesh in scene.meshes}
        return {mesh: name.replace("displayColor", "") for mesh, name in names.items()}

    return read_bound


@pytest.mark.parametrize(
    ("outer", "inner", "expected"),
    [
        ("", "", "/B"),
        (WEAK, "", "/B"),
        (STRONG, "", "/A"),
        (STRONG, STRONG, "/A"),  # the outermost of the strong
        ("", STRONG, "/B"),
    ],
)
def test_a_binding_is_overridden_by_a_stronger_one_above(bound, outer, inner, expected):
    body = f"""def Xform "x" {API} {{ rel material:binding = </A> {outer}
        def Cube "c" {API} {{ rel material:binding = </B> {inner} }} }}"""
    assert bound(body) == {"/x/c": expected}


def test_bindings_are_inherited(bound):
    body = f"""def Xform "x" {API} {{ rel material:binding = </A>
        def Xform "y" {{ def Cube "c" {{ }} }} }}
        def Cube "d" {{ }}"""
    assert bound(body) == {"/x/y/c": "/A", "/d": ""}


COLLECTION = '( prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:some"] )'


def test_a_collection_binds_its_members_and_is_stronger_than_the_direct_binding_beside_it(bound):
    body = f"""def Xform "x" {COLLECTION} {{
        rel collection:some:includes = [</x/c>, </x/e>]
        rel material:binding = </A>
        rel material:binding:collection:some = [</x.collection:some>, </B>]
        def Cube "c" {{ }}
        def Cube "d" {{ }}
        def Cube "e" {API} {{ rel material:binding = </C> }} }}"""
    assert bound(body) == {"/x/c": "/B", "/x/d": "/A", "/x/e": "/C"}
    strong = body.replace("</x.collection:some>, </B>]", f"</x.collection:some>, </B>] {STRONG}")
    assert bound(strong) == {"/x/c": "/B", "/x/d": "/A", "/x/e": "/B"}


def test_a_collection_may_exclude_prims_and_use_expressions(bound):
    body = f"""def Xform "x" {COLLECTION} {{
        MEMBERS
        rel material:binding:collection:some = [</x.collection:some>, </B>]
        def Cube "c" {{ }}
        def Cube "d" {{ }} }}"""
    excluded = "rel collection:some:includes = </x>\nrel collection:some:excludes = </x/d>"
    assert bound(body.replace("MEMBERS", excluded)) == {"/x/c": "/B", "/x/d": ""}
    expression = 'pathExpression collection:some:membershipExpression = "/x/d"'
    assert bound(body.replace("MEMBERS", expression)) == {"/x/c": "", "/x/d": "/B"}


PURPOSES = f"""def Cube "all" {API} {{
    rel material:binding = </A>
    rel material:binding:full = </B>
    rel material:binding:preview = </C> }}
def Cube "preview" {API} {{
    rel material:binding = </A>
    rel material:binding:preview = </C> }}
def Cube "only" {API} {{ rel material:binding:preview = </C> }}"""
SETTINGS = """def Scope "Render" {{ def RenderSettings "s" {{
    uniform token[] materialBindingPurposes = {} }} }}"""


@pytest.mark.parametrize(
    ("purposes", "expected"),
    [
        (None, ("/B", "/A", "")),  # full, then all purposes
        ('["full", ""]', ("/B", "/A", "")),
        ('["preview", ""]', ("/C", "/C", "/C")),
        ('[""]', ("/A", "/A", "")),
    ],
)
def test_purposes(bound, purposes, expected):
    metadata = "" if purposes is None else 'renderSettingsPrimPath = "/Render/s"'
    body = PURPOSES + ("" if purposes is None else SETTINGS.format(purposes))
    assert bound(body, metadata) == dict(zip(("/all", "/preview", "/only"), expected, strict=True))


def test_a_purpose_bound_above_loses_to_one_bound_below_only_of_its_own_kind(bound):
    """For "full", what is bound for it above is before what is bound for all purposes below."""
    body = f"""def Xform "x" {API} {{ rel material:binding:full = </A>
        def Cube "c" {API} {{ rel material:binding = </B> }} }}"""
    assert bound(body) == {"/x/c": "/A"}


def test_subsets_have_their_own_and_the_rest_has_the_meshs(read):
    scene = read(
        LOOKS
        + f"""def Mesh "m" {API} {{
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 2, 3, 0]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        uniform token subdivisionScheme = "none"
        rel material:binding = </A>
        def GeomSubset "s" {API} {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </B> }} }}"""
    )
    assert [scene.materials[i].name for i in scene.meshes[0].materials] == ["/A", "/B"]


CONTEXTS = """
def Material "M" {
    OUTPUTS
    def Shader "usd" { uniform token info:id = "UsdPreviewSurface"
        token outputs:surface }
    def Shader "mtlx" { uniform token info:id = "ND_standard_surface_surfaceshader"
        token outputs:out }
    def Shader "other" { uniform token info:id = "PxrSurface"
        token outputs:out }
}
def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }
"""
UNIVERSAL = "token outputs:surface.connect = </M/usd.outputs:surface>\n"
MTLX = "token outputs:mtlx:surface.connect = </M/mtlx.outputs:out>\n"
OTHER = "token outputs:ri:surface.connect = </M/other.outputs:out>\n"
UNKNOWN = MTLX.replace("mtlx.outputs", "other.outputs")
STANDARD = Layer(
    Dielectric(1.5, pytest.approx(0.04), (1.0, 1.0, 1.0), 1.0), Diffuse((0.8, 0.8, 0.8), 1.0, 0.0)
)


@pytest.mark.parametrize(
    ("outputs", "expected", "says"),
    [
        (UNIVERSAL, PreviewSurface(), None),
        (MTLX, STANDARD, None),
        (UNIVERSAL + MTLX, STANDARD, None),  # MaterialX before the universal one
        (UNIVERSAL + OTHER, PreviewSurface(), None),
        (UNIVERSAL + UNKNOWN, PreviewSurface(), None),  # one that is not known is passed over
        (UNKNOWN, None, "PxrSurface are not rendered"),
        (OTHER, None, "for other renderers only (ri)"),
    ],
)
def test_render_contexts(read, examine, outputs, expected, says):
    body = CONTEXTS.replace("OUTPUTS", outputs)
    material = read(body).materials[0]
    if expected is None:
        assert material.name == "displayColor"
    else:
        assert material.closure == expected
    kinds = [w.kind for w in examine(body).warnings if "no lights" not in w.kind]
    assert len(kinds) == (0 if says is None else 1)
    assert says is None or says in kinds[0]
