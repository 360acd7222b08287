"""Render passes: what their collections leave of a stage."""

from __future__ import annotations

import pytest

STAGE = """
def Xform "a" {
    def Cube "one" {}
    def Cube "two" {}
}
def Xform "b" {
    def Cube "three" {}
    def SphereLight "lamp" {}
}
def SphereLight "sun" {}
def RenderSettings "s" {}
def RenderPass "p" {
    rel renderSource = </s>
    COLLECTIONS
}
"""


@pytest.fixture
def rendered(read):
    """The names of meshes and lights that a pass with the given collections renders."""

    def names(collections: str, asked: bool = True) -> set[str]:
        options = {"render_pass": "/p"} if asked else {}
        scene = read(STAGE.replace("COLLECTIONS", collections), **options)
        return {thing.name for thing in (*scene.meshes, *scene.lights)}

    return names


ALL = {"/a/one", "/a/two", "/b/three", "/b/lamp", "/sun"}


@pytest.mark.parametrize(
    ("collections", "left"),
    [
        ("", ALL),
        ("rel collection:prune:includes = </b>", {"/a/one", "/a/two", "/sun"}),
        ("rel collection:prune:includes = [</a/one>, </sun>]", ALL - {"/a/one", "/sun"}),
        ("rel collection:renderVisibility:excludes = </a>", ALL - {"/a/one", "/a/two"}),
        (
            """bool collection:renderVisibility:includeRoot = 0
            rel collection:renderVisibility:includes = [</a/two>, </sun>]""",
            {"/a/two", "/sun"},
        ),
        # What is visible again below something that is not:
        (
            """rel collection:renderVisibility:excludes = </a>
            rel collection:renderVisibility:includes = </a/two>""",
            ALL - {"/a/one"},
        ),
    ],
)
def test_a_pass_renders_what_its_collections_leave(rendered, collections, left):
    assert rendered(collections) == left


def test_a_pass_that_is_not_asked_for_takes_nothing_away(rendered):
    assert rendered("rel collection:prune:includes = </b>", asked=False) == ALL


def test_an_instance_is_pruned_and_its_like_is_not(write):
    from usdmlt.stage import load

    write('def Xform "x" { def Cube "c" {} }', 'defaultPrim = "x"', name="part.usda")
    text = """
def "i" (instanceable = true\n prepend references = @part.usda@) {}
def "j" (instanceable = true\n prepend references = @part.usda@) {}
def RenderSettings "s" {}
def RenderPass "p" {
    rel renderSource = </s>
    rel collection:prune:includes = </i>
}
"""
    stage = write(text)
    assert [len(i.transforms) for i in load(stage).instances] == [2]
    left = load(stage, render_pass="/p")
    assert (len(left.meshes), left.instances) == (1, [])


def test_camera_visibility_and_mattes_are_one_warning(examine):
    text = STAGE.replace(
        "COLLECTIONS",
        "rel collection:matte:includes = </a>\nrel collection:cameraVisibility:excludes = </b>",
    )
    warnings = {w.kind: w.paths for w in examine(text, render_pass="/p").warnings}
    assert warnings["camera visibility and mattes of render passes are ignored"] == [
        "/p (cameraVisibility)",
        "/p (matte)",
    ]
