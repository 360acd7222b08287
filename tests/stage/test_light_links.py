"""``collection:lightLink``: what of a stage a light is linked to."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from support.usda import instance
from usdmlt.errors import Error
from usdmlt.scene import Scene

FIXED = "uniform bool collection:lightLink:includeRoot = false"


def light(links: str, name: str = "key", kind: str = "SphereLight") -> str:
    return f'def {kind} "{name}" {{ {links} }}'


def mesh(name: str) -> str:
    return f'def Mesh "{name}" {{ QUAD }}'


def lit(scene: Scene, name: str = "/key") -> set[str]:
    """Names of the meshes that a light illuminates, by the core's own rule."""
    link = next(light.light_link for light in scene.lights if light.name == name)
    meshes = [*scene.meshes, *(m for p in scene.prototypes for m in p.meshes)]
    return {m.name for m in meshes if link is None or link in m.collections}


@pytest.fixture
def lit_by(read: Callable[..., Scene]) -> Callable[..., set[str]]:
    """What a sphere light of the given links illuminates of a stage."""

    def read_links(links: str, body: str, **options: object) -> set[str]:
        return lit(read(light(links) + body, **options))

    return read_links


THREE = f'def Xform "set" {{ {mesh("a")} {mesh("b")} }} {mesh("c")}'


@pytest.mark.parametrize(
    ("links", "members"),
    [
        ("", {"/set/a", "/set/b", "/c"}),
        ("uniform bool collection:lightLink:includeRoot = true", {"/set/a", "/set/b", "/c"}),
        ("rel collection:lightLink:includes = </c>", {"/set/a", "/set/b", "/c"}),
        ("rel collection:lightLink:excludes = </set>", {"/c"}),
        ("rel collection:lightLink:excludes = </set/b>", {"/set/a", "/c"}),
        (f"{FIXED}\nrel collection:lightLink:includes = </set>", {"/set/a", "/set/b"}),
        (f"{FIXED}\nrel collection:lightLink:includes = [</set/a>, </c>]", {"/set/a", "/c"}),
        (
            f"{FIXED}\nrel collection:lightLink:includes = </set>"
            "\nrel collection:lightLink:excludes = </set/a>",
            {"/set/b"},
        ),
        (
            f"{FIXED}\nrel collection:lightLink:includes = [</set>, </c>]"
            '\nuniform token collection:lightLink:expansionRule = "explicitOnly"',
            {"/c"},
        ),
        (
            f'{FIXED}\nuniform pathExpression collection:lightLink:membershipExpression = "//a /c"',
            {"/set/a", "/c"},
        ),
        (FIXED, set()),
        (f"{FIXED}\nrel collection:lightLink:includes = </nothing>", set()),
    ],
)
def test_members_of_the_collection_are_lit(lit_by, links, members):
    assert lit_by(links, THREE) == members


def test_collections_may_be_of_collections(lit_by):
    body = f"""{THREE}
    def Scope "groups" (prepend apiSchemas = ["CollectionAPI:heroes", "CollectionAPI:all"]) {{
        rel collection:heroes:includes = </set>
        rel collection:heroes:excludes = </set/b>
        rel collection:all:includes = [</groups.collection:heroes>, </c>]
    }}"""
    links = f"{FIXED}\nrel collection:lightLink:includes = "
    assert lit_by(links + "</groups.collection:heroes>", body) == {"/set/a"}
    assert lit_by(links + "</groups.collection:all>", body) == {"/set/a", "/c"}


def test_a_collection_of_itself_is_no_hang(examine):
    found = examine(
        light(f"{FIXED}\nrel collection:lightLink:includes = </key.collection:lightLink>") + THREE
    )
    assert found.lights == [("SphereLight", "/key")]


@pytest.mark.parametrize(
    "kind", ["RectLight", "DiskLight", "CylinderLight", "DistantLight", "DomeLight", "DomeLight_1"]
)
def test_every_light_has_links(read, kind):
    assert lit(read(light("rel collection:lightLink:excludes = </c>", kind=kind) + THREE)) == {
        "/set/a",
        "/set/b",
    }


def test_mesh_lights_have_links(read):
    scene = read(f"""{THREE}
    def Mesh "lamp" (prepend apiSchemas = ["MeshLightAPI"]) {{
        QUAD
        rel collection:lightLink:excludes = </c>
    }}""")
    links = {m.name: (m.light_link, m.collections) for m in scene.meshes}
    name = "/lamp.collection:lightLink"
    assert links["/lamp"] == (name, {name})
    assert links["/set/a"] == (None, {name})
    assert links["/c"] == (None, frozenset())


def test_lights_of_the_same_members_share_a_collection(read):
    first = "rel collection:lightLink:excludes = [</c>, </set/a>]"
    second = f"{FIXED}\nrel collection:lightLink:includes = </set/b>"
    third = "rel collection:lightLink:excludes = [</set/a>, </c>]"
    scene = read(light(first, "x") + light(second, "y") + light(third, "z") + THREE)
    links = {light.name: light.light_link for light in scene.lights}
    assert links["/x"] == links["/z"] != links["/y"]


def test_nothing_is_noted_where_no_light_is_linked(read):
    scene = read(light("uniform bool collection:lightLink:includeRoot = true") + THREE)
    assert scene.lights[0].light_link is None
    assert not any(m.collections for m in scene.meshes)


ASSET = f'class "asset" {{ {mesh("a")} {mesh("b")} }}'


def instanced(*names: str) -> str:
    return ASSET + "".join(instance(name) for name in names)


def placements(scene: Scene) -> dict[str, int]:
    """How often each mesh is there, by the prefix of its name."""
    found = {mesh.name: 1 for mesh in scene.meshes}
    for entry in scene.instances:
        for mesh in scene.prototypes[entry.prototype].meshes:
            found[mesh.name] = len(entry.transforms)
    return found


def test_instances_that_are_lit_alike_are_shared(read):
    body = instanced("i", "j", "k", "l")
    scene = read(light("rel collection:lightLink:excludes = [</j>, </k>]") + body)
    assert lit(scene) == {"/i/a", "/i/b"}
    assert placements(scene) == {"/i/a": 2, "/i/b": 2, "/j/a": 2, "/j/b": 2}


def test_collections_reach_into_instances(read):
    scene = read(light("rel collection:lightLink:excludes = </j/b>") + instanced("i", "j", "k"))
    assert lit(scene) == {"/i/a", "/i/b", "/j/a"}
    assert placements(scene) == {"/i/a": 2, "/i/b": 2, "/j/a": 1, "/j/b": 1}


def test_expressions_reach_into_instances(read):
    links = f'{FIXED}\nuniform pathExpression collection:lightLink:membershipExpression = "/j//a"'
    scene = read(light(links) + instanced("i", "j", "k"))
    assert lit(scene) == {"/j/a"}


def test_instances_inside_of_instances(read):
    body = f"""{ASSET}
    class "outer" {{ {instance("inner")} }}
    {instance("i", of="/outer")} {instance("j", of="/outer")}"""
    scene = read(light("rel collection:lightLink:excludes = </j/inner/a>") + body)
    assert lit(scene) == {"/i/inner/a", "/i/inner/b", "/j/inner/b"}


def test_a_light_in_an_instance_is_linked_to_what_is_beside_it(read):
    lamp = light("rel collection:lightLink:excludes = </asset/b>")
    body = f"""class "asset" {{ {mesh("a")} {mesh("b")} {lamp} }}
    {instance("i")} {instance("j")}"""
    scene = read(body)
    assert lit(scene, "/i/key") == {"/i/a", "/j/a", "/j/b"}
    assert lit(scene, "/j/key") == {"/i/a", "/i/b", "/j/a"}


def test_a_light_in_an_instance_that_is_linked_elsewhere_needs_no_copies(read):
    lamp = light(FIXED)
    body = f'class "asset" {{ {mesh("a")} {mesh("b")} {lamp} }} {instance("i")} {instance("j")}'
    scene = read(body)
    assert lit(scene, "/i/key") == set()
    assert placements(scene) == {"/i/a": 2, "/i/b": 2}


def instancer(prototypes: str) -> str:
    return f"""def PointInstancer "trees" {{
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (2, 0, 0)]
        rel prototypes = <{prototypes}>
        {mesh("tree")}
    }}
    {mesh("c")}
    def Xform "elsewhere" {{ {mesh("shrub")} }}"""


@pytest.mark.parametrize(
    ("links", "members"),
    [
        ("rel collection:lightLink:excludes = </trees>", {"/c", "/elsewhere/shrub"}),
        ("rel collection:lightLink:excludes = </trees/tree>", {"/c", "/elsewhere/shrub"}),
        (f"{FIXED}\nrel collection:lightLink:includes = </trees>", {"/trees/tree"}),
        (f"{FIXED}\nrel collection:lightLink:includes = </c>", {"/c"}),
    ],
)
def test_prototypes_inside_of_a_point_instancer(lit_by, links, members):
    assert lit_by(links, instancer("/trees/tree")) == members


@pytest.mark.parametrize(
    ("links", "is_lit"),
    [
        ("rel collection:lightLink:excludes = </trees>", False),
        ("rel collection:lightLink:excludes = </elsewhere/shrub>", False),
        (f"{FIXED}\nrel collection:lightLink:includes = </trees>", True),
        (f"{FIXED}\nrel collection:lightLink:includes = </elsewhere>", True),
        (f"{FIXED}\nrel collection:lightLink:includes = </c>", False),
        (
            f"{FIXED}\nrel collection:lightLink:includes = </elsewhere>"
            "\nrel collection:lightLink:excludes = </elsewhere/shrub>",
            False,
        ),
    ],
)
def test_prototypes_outside_of_a_point_instancer(read, links, is_lit):
    scene = read(light(links) + instancer("/elsewhere/shrub"))
    (prototype,) = scene.prototypes
    (shrub,) = prototype.meshes
    assert (scene.lights[0].light_link in shrub.collections) == is_lit


def test_points_and_cards_are_members_by_their_prims(lit_by):
    body = """def Points "dots" { point3f[] points = [(0, 0, 0), (2, 0, 0)]
        float[] widths = [1, 1] }
    def Xform "model" (
        kind = "component"
        prepend apiSchemas = ["GeomModelAPI"]
    ) {
        uniform token model:drawMode = "bounds"
        uniform bool model:applyDrawMode = 1
        def Mesh "m" { QUAD }
    }"""
    links = f"{FIXED}\nrel collection:lightLink:includes = "
    assert lit_by(links + "</dots>", body) == {"/dots"}
    assert lit_by(links + "</model>", body) == {"/model"}


def test_links_do_not_stop_a_strict_reading(read):
    read(light("rel collection:lightLink:excludes = </c>") + THREE, strict=True)


@pytest.mark.parametrize("collection", ["includes = </c>", "excludes = </c>"])
def test_shadow_links_are_warned_of(read, collection):
    root = "uniform bool collection:shadowLink:includeRoot = false"
    links = f"{root}\nrel collection:shadowLink:{collection}"
    with pytest.raises(Error, match="shadow linking is ignored"):
        read(light(links) + THREE, strict=True)
    read(light("uniform bool collection:shadowLink:includeRoot = true") + THREE, strict=True)
