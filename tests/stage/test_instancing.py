"""Native instances and point instancers: flattened, shared, and where USD puts them."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from usdmlt.errors import Error
from usdmlt.stage import load


def placed(scene) -> dict[str, list[np.ndarray]]:
    """Every world transform of every gprim, by the name of the prim."""
    found: dict[str, list[np.ndarray]] = {}
    for mesh in scene.meshes:
        found.setdefault(mesh.name.split("/")[-1], []).append(mesh.transform)
    for instances in scene.instances:
        for mesh in scene.prototypes[instances.prototype].meshes:
            for transform in instances.transforms:
                found.setdefault(mesh.name.split("/")[-1], []).append(mesh.transform @ transform)
    return found


def as_set(transforms) -> np.ndarray:
    """Transforms in an order that does not depend on how they were found."""
    rows = np.round(np.array([np.ravel(t) for t in transforms]), 6) + 0.0
    return rows[np.lexsort(rows.T)]


NESTED = """
class "Leaf" {
    def Cube "leaf" {
        double3 xformOp:translate = (0.5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
class "Branch" {
    def Cube "branch" {}
    def Xform "l1" (instanceable = true
        references = </Leaf>
    ) {
        double3 xformOp:translate = (0, 3, 0)
        float xformOp:rotateZ = 30
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
    }
    def Xform "l2" (instanceable = true
        references = </Leaf>
    ) {
        float3 xformOp:scale = (1, -2, 1)
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }
}
def Xform "forest" {
    float xformOp:rotateY = 20
    uniform token[] xformOpOrder = ["xformOp:rotateY"]
    def Xform "t1" (instanceable = true
        references = </Branch>
    ) {
        double3 xformOp:translate = (10, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "t2" (instanceable = true
        references = </Branch>
    ) {
        float xformOp:rotateX = 70
        uniform token[] xformOpOrder = ["xformOp:rotateX"]
    }
    def Xform "t3" (instanceable = true
        references = </Branch>
    ) { token visibility = "invisible" }
}
"""


def test_nested_native_instances_are_where_usd_composes_them(write):
    stage = Usd.Stage.Open(str(write(NESTED)))
    cache = UsdGeom.XformCache()
    expected: dict[str, list[np.ndarray]] = {}
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Cube) and "/t3/" not in str(prim.GetPath()):
            world = np.array(cache.GetLocalToWorldTransform(prim))
            expected.setdefault(prim.GetName(), []).append(world)
    scene = load(stage)
    found = placed(scene)
    assert {name: len(t) for name, t in found.items()} == {"leaf": 4, "branch": 2}
    for name, transforms in expected.items():
        assert as_set(found[name]) == pytest.approx(as_set(transforms), abs=1e-6)


def test_each_prototype_is_read_once(write):
    scene = load(write(NESTED))
    assert len(scene.prototypes) == 2
    assert sorted(len(i.transforms) for i in scene.instances) == [2, 4]


def test_what_is_placed_once_becomes_a_plain_mesh(read):
    scene = read("""
        class "P" { def Cube "c" {} }
        def Xform "x" (instanceable = true
            references = </P>
        ) {
            double3 xformOp:translate = (1, 2, 3)
            uniform token[] xformOpOrder = ["xformOp:translate"] }""")
    assert (len(scene.meshes), len(scene.instances)) == (1, 0)
    assert scene.meshes[0].transform[3, :3].tolist() == [1, 2, 3]


COLORED = """
class "P" { def Cube "c" {} }
def Xform "a" (instanceable = true
    references = </P>
) { color3f[] primvars:displayColor = [(COLOR_A)] ( interpolation = "constant" ) }
def Xform "b" (instanceable = true
    references = </P>
) { color3f[] primvars:displayColor = [(COLOR_B)] ( interpolation = "constant" ) }
"""


def test_instances_that_inherit_different_colors_do_not_share(read):
    scene = read(COLORED.replace("COLOR_A", "1, 0, 0").replace("COLOR_B", "0, 1, 0"))
    colors = [mesh.primvars["displayColor"].values[0].tolist() for mesh in scene.meshes]
    assert colors == [[1, 0, 0], [0, 1, 0]]


def test_instances_that_inherit_equal_colors_share(read):
    scene = read(COLORED.replace("COLOR_A", "1, 0, 0").replace("COLOR_B", "1, 0, 0"))
    assert [len(i.transforms) for i in scene.instances] == [2]


def material(name: str) -> str:
    return f"""def Material "{name}" {{
        token outputs:surface.connect = </{name}/s.outputs:surface>
        def Shader "s" {{
            uniform token info:id = "UsdPreviewSurface"
            token outputs:surface
        }} }}"""


INSTANCE = """def Xform "{name}" (
    instanceable = true
    references = </P>
    prepend apiSchemas = ["MaterialBindingAPI"]
) {{
    rel material:binding = <{material}> {strength}
}}
"""
STRONG = '( bindMaterialAs = "strongerThanDescendants" )'


def test_materials_bound_outside_tell_instances_apart(read):
    scene = read(
        material("A")
        + material("B")
        + 'class "P" { def Cube "c" {} }'
        + INSTANCE.format(name="x", material="/A", strength="")
        + INSTANCE.format(name="y", material="/B", strength="")
        + INSTANCE.format(name="z", material="/A", strength="")
    )
    bound = {mesh.name: scene.materials[mesh.materials].name for mesh in scene.meshes}
    assert bound == {"/y/c": "/B"}
    prototype = scene.prototypes[scene.instances[0].prototype]
    assert scene.materials[prototype.meshes[0].materials].name == "/A"
    assert len(scene.instances[0].transforms) == 2


def test_a_stronger_binding_outside_overrides_the_one_inside(read):
    scene = read(
        material("A")
        + material("B")
        + """class "P" {
            def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) {
                rel material:binding = </B> } }"""
        + INSTANCE.format(name="x", material="/A", strength="")
        + INSTANCE.format(name="y", material="/A", strength=STRONG)
    )
    bound = {mesh.name: scene.materials[mesh.materials].name for mesh in scene.meshes}
    assert bound == {"/x/c": "/B", "/y/c": "/A"}


def test_collections_that_bind_inside_one_instance_are_followed(read):
    scene = read(
        material("A")
        + """class "P" { def Cube "c" {}\ndef Cube "d" {} }
        def Xform "w" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:some"]) {
            rel collection:some:includes = </w/x/c>
            rel material:binding:collection:some = [</w.collection:some>, </A>]
            def Xform "x" (instanceable = true
                references = </P>
            ) {}
            def Xform "y" (instanceable = true
                references = </P>
            ) {}
        }"""
    )
    bound = {mesh.name: scene.materials[mesh.materials].name for mesh in scene.meshes}
    assert bound["/w/x/c"] == "/A"
    assert bound["/w/y/c"] == bound["/w/x/d"] == "displayColor"


def test_lights_inside_instances_shine_from_each(read):
    scene = read("""
        class "P" { def SphereLight "l" {
            double3 xformOp:translate = (0, 1, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] } }
        def Xform "a" (instanceable = true
            references = </P>
        ) {}
        def Xform "b" (instanceable = true
            references = </P>
        ) { double3 xformOp:translate = (5, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }""")
    positions = sorted(light.transform[3, :3].tolist() for light in scene.lights)
    assert positions == [[0, 1, 0], [5, 1, 0]]


# ---------------------------------------------------------------------------------------------
# Point instancers

SCATTER = """
def PointInstancer "i" {
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]
    quath[] orientations = [(1, 0, 0, 0), (0.70703125, 0, 0, 0.70703125),
                            (1, 0, 0, 0), (1, 0, 0, 0)]
    float3[] scales = [(1, 1, 1), (1, 2, 3), (1, 1, 1), (2, 2, 2)]
    int[] protoIndices = [0, 1, 0, 1]
    rel prototypes = [</i/protos/a>, </i/protos/b>]
    EXTRA
    def Scope "protos" {
        def Cube "a" {
            double3 xformOp:translate = (0, 10, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def Xform "b" { def Cube "b" {
            float3 xformOp:scale = (0.5, 0.5, 0.5)
            uniform token[] xformOpOrder = ["xformOp:scale"] } }
    }
}
"""


def expected_transforms(stage: Usd.Stage, masked: bool = True) -> dict[str, list[np.ndarray]]:
    """What USD computes for the instancer above, prototypes' own transforms included."""
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/i"))
    time = Usd.TimeCode.EarliestTime()
    to_world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(instancer.GetPrim()))
    transforms = instancer.ComputeInstanceTransformsAtTime(
        time, time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    )
    mask = instancer.ComputeMaskAtTime(time) or [True] * len(transforms)
    inner = np.array(
        UsdGeom.Xformable(stage.GetPrimAtPath("/i/protos/b/b")).GetLocalTransformation(time)
    )
    expected: dict[str, list[np.ndarray]] = {"a": [], "b": []}
    for index, transform, shown in zip(
        instancer.GetProtoIndicesAttr().Get(), transforms, mask, strict=True
    ):
        world = np.array(transform) @ to_world
        if shown:
            expected["ab"[index]].append(world if index == 0 else inner @ world)
    return expected


@pytest.mark.parametrize(
    ("extra", "count"),
    [
        ("", 4),
        ("int64[] invisibleIds = [1, 2]", 2),
        ("int64[] ids = [10, 20, 30, 40]\nint64[] invisibleIds = [40]", 3),
    ],
)
def test_point_instances_are_where_usd_puts_them(write, extra, count):
    stage = Usd.Stage.Open(str(write(SCATTER.replace("EXTRA", extra))))
    found, expected = placed(load(stage)), expected_transforms(stage)
    assert sum(len(transforms) for transforms in found.values()) == count
    for name, transforms in expected.items():
        if transforms:
            assert as_set(found[name]) == pytest.approx(as_set(transforms), abs=1e-6)


def test_inactive_ids_hide_instances_too(write):
    path = write(SCATTER.replace("EXTRA", ""))
    stage = Usd.Stage.Open(str(path))
    UsdGeom.PointInstancer(stage.GetPrimAtPath("/i")).DeactivateIds([0, 1])
    found = placed(load(stage))
    assert sum(len(transforms) for transforms in found.values()) == 2


def test_prototypes_are_not_drawn_for_themselves(read):
    scene = read(SCATTER.replace("EXTRA", ""))
    assert not scene.meshes
    assert len(scene.prototypes) == 2


def test_prototypes_may_live_in_overs_and_invisible_scopes(read):
    scene = read("""
        def PointInstancer "i" {
            point3f[] positions = [(0, 0, 0), (1, 0, 0)]
            int[] protoIndices = [0, 1]
            rel prototypes = [</hidden/a>, </library/b>] }
        def Scope "hidden" { token visibility = "invisible"
            def Cube "a" {} }
        over "library" { def Cube "b" {} }""")
    assert sorted(mesh.name for mesh in scene.meshes) == ["/hidden/a", "/library/b"]


def test_an_instancer_inside_a_prototype_of_an_instancer_is_flattened(read):
    scene = read("""
        def PointInstancer "outer" {
            point3f[] positions = [(0, 0, 0), (100, 0, 0), (200, 0, 0)]
            int[] protoIndices = [0, 0, 0]
            rel prototypes = </outer/inner>
            def PointInstancer "inner" {
                point3f[] positions = [(0, 0, 0), (10, 0, 0)]
                int[] protoIndices = [0, 0]
                rel prototypes = </outer/inner/c>
                def Cube "c" {
                    double3 xformOp:translate = (1, 0, 0)
                    uniform token[] xformOpOrder = ["xformOp:translate"] } } }""")
    x = sorted(t[3, 0] for t in placed(scene)["c"])
    assert x == [1, 11, 101, 111, 201, 211]
    assert len(scene.prototypes) == 1


def test_native_instances_hold_point_instancers_and_the_other_way_round(read):
    scene = read("""
        class "Tuft" { def PointInstancer "i" {
            point3f[] positions = [(0, 0, 0), (1, 0, 0)]
            int[] protoIndices = [0, 0]
            rel prototypes = </Tuft/i/blade>
            def Xform "blade" (instanceable = true
                references = </Blade>
            ) {} } }
        class "Blade" { def Cube "c" {} }
        def Xform "t1" (instanceable = true
            references = </Tuft>
        ) {}
        def Xform "t2" (instanceable = true
            references = </Tuft>
        ) { double3 xformOp:translate = (0, 5, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }""")
    positions = sorted(t[3, :2].tolist() for t in placed(scene)["c"])
    assert positions == [[0, 0], [0, 5], [1, 0], [1, 5]]


def test_instances_scaled_to_nothing_are_left_out_with_a_warning(examine):
    found = examine("""def PointInstancer "i" {
        point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
        float3[] scales = [(1, 1, 1), (0, 0, 0), (1, 1, 1)]
        int[] protoIndices = [0, 0, 0]
        rel prototypes = </i/c>
        def Cube "c" {} }""")
    assert found.instances == 2
    assert any("scaled to nothing" in w.kind for w in found.warnings)


TINTED = """def PointInstancer "i" {{
    point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]
    int[] protoIndices = [0, 0, 1, 0]
    {primvar}
    rel prototypes = [</i/c>, </i/own>]
    def Cube "c" {{}}
    def Cube "own" {{ color3f[] primvars:displayColor = [(0, 0, 1)] }} }}"""


def tints(scene) -> dict[float, tuple]:
    """The displayColor of what is at each x."""
    found = {}
    for mesh in scene.meshes:
        found[mesh.transform[3, 0]] = mesh
    for instances in scene.instances:
        for transform in instances.transforms:
            for mesh in scene.prototypes[instances.prototype].meshes:
                found[(mesh.transform @ transform)[3, 0]] = mesh
    return {
        float(x): tuple(mesh.primvars["displayColor"].values[0].tolist())
        for x, mesh in sorted(found.items())
    }


@pytest.mark.parametrize(
    "values",
    [
        '[(1, 0, 0), (0, 1, 0), (1, 1, 1), (1, 0, 0)] ( interpolation = "vertex" )',
        '[(1, 0, 0), (0, 1, 0), (1, 1, 1)] ( interpolation = "varying" )\n'
        "int[] primvars:displayColor:indices = [0, 1, 2, 0]",
    ],
)
def test_primvars_per_point_instance_reach_their_instance(read, values):
    scene = read(TINTED.format(primvar=f"color3f[] primvars:displayColor = {values}"))
    # What the prototype says itself is stronger than what it gets from above.
    assert tints(scene) == {0: (1, 0, 0), 1: (0, 1, 0), 2: (0, 0, 1), 3: (1, 0, 0)}
    # Those of the same colour share a prototype.
    assert [len(i.transforms) for i in scene.instances] == [2]


def test_inner_instances_values_are_stronger_than_outer_ones(read):
    scene = read("""
        def PointInstancer "outer" {
            point3f[] positions = [(0, 0, 0), (100, 0, 0)]
            int[] protoIndices = [0, 0]
            color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" )
            rel prototypes = </outer/group>
            def Xform "group" {
                def PointInstancer "tinted" {
                    point3f[] positions = [(1, 0, 0)]
                    int[] protoIndices = [0]
                    color3f[] primvars:displayColor = [(0, 0, 1)] ( interpolation = "vertex" )
                    rel prototypes = </outer/group/tinted/c>
                    def Cube "c" {}
                }
                def PointInstancer "plain" {
                    point3f[] positions = [(2, 0, 0)]
                    int[] protoIndices = [0]
                    rel prototypes = </outer/group/plain/c>
                    def Cube "c" {}
                }
            } }""")
    assert tints(scene) == {1: (0, 0, 1), 2: (1, 0, 0), 101: (0, 0, 1), 102: (0, 1, 0)}


def test_very_many_values_are_rounded_with_a_note(examine, read):
    count = 5000
    rng = np.random.default_rng(1)
    colors = np.round(rng.random((count, 3)), 4)
    body = f"""def PointInstancer "i" {{
        point3f[] positions = {[(float(i), 0.0, 0.0) for i in range(count)]}
        int[] protoIndices = {[0] * count}
        color3f[] primvars:displayColor = {[tuple(c) for c in colors.tolist()]} (
            interpolation = "vertex" )
        rel prototypes = </i/c>
        def Cube "c" {{}} }}"""
    assert [len(w.paths) for w in examine(body).warnings if "rounded" in w.kind] == [1]
    found = tints(read(body))
    assert len(found) == count
    assert len(set(found.values())) <= 4096
    assert np.abs(np.array(list(found.values())) - colors).max() < 0.05


def test_primvars_per_point_instance_of_the_wrong_number_are_warned_of(examine):
    found = examine(
        TINTED.format(
            primvar='color3f[] primvars:displayColor = [(1, 0, 0)] ( interpolation = "vertex" )'
        )
    )
    assert [w.paths for w in found.warnings if "does not fit" in w.kind] == [
        ["/i.primvars:displayColor (1 vertex)"]
    ]


INSTANCER = """def PointInstancer "i" {{
    point3f[] positions = {positions}
    int[] protoIndices = {indices}
    rel prototypes = {prototypes}
    def Cube "c" {{}} }}"""


@pytest.mark.parametrize(
    ("positions", "indices", "prototypes", "says"),
    [
        ("[(0, 0, 0)]", "[1]", "</i/c>", r"/i: protoIndices has 1, but there are 1 prototypes"),
        ("[(0, 0, 0)]", "[-1]", "</i/c>", r"/i: protoIndices has -1"),
        ("[(0, 0, 0), (1, 0, 0)]", "[0]", "</i/c>", r"/i: positions, .* do not match"),
        ("[(0, nan, 0)]", "[0]", "</i/c>", r"/i: positions, .* not finite"),
        ("[(0, 0, 0)]", "[0]", "</gone>", r"/i: its prototype /gone does not exist"),
    ],
)
def test_broken_point_instancers_name_their_path(read, positions, indices, prototypes, says):
    with pytest.raises(Error, match=says):
        read(INSTANCER.format(positions=positions, indices=indices, prototypes=prototypes))


def test_a_prototype_that_contains_its_instancer_is_refused(read):
    with pytest.raises(Error, match="contains itself"):
        read("""def Xform "x" { def PointInstancer "i" {
            point3f[] positions = [(0, 0, 0)]
            int[] protoIndices = [0]
            rel prototypes = </x> } }""")


@pytest.mark.parametrize("targets", ["</a>", "</b>", "</b/inner>"])
def test_circles_of_instancers_without_instances_are_refused(read, targets):
    """Nothing would be drawn, but USD's own bounds would never end."""
    with pytest.raises(Error, match=r"^/.*: a prototype that contains itself$"):
        read(f"""def PointInstancer "a" {{ int[] protoIndices = []
                point3f[] positions = []
                rel prototypes = {targets} }}
            def Xform "b" {{ def PointInstancer "inner" {{
                int[] protoIndices = []
                rel prototypes = </a> }} }}
            def Mesh "m" {{}}""")


def test_a_flattened_instance_is_refused_with_its_path(read):
    with pytest.raises(Error, match="/x: the transform is singular"):
        read("""class "P" { def Cube "c" {} }
            def Xform "x" (instanceable = true
                references = </P>
            ) { float3 xformOp:scale = (1, 0, 1)
                uniform token[] xformOpOrder = ["xformOp:scale"] }""")
