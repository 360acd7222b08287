"""UsdSkel: the same points that USD bakes."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel

from usdmlt.stage import load

# Two joints; the quad's right edge follows the second, half of it by half.
SKINNED = """
def SkelRoot "Model" {
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Skeleton "skeleton" (prepend apiSchemas = ["SkelBindingAPI"]) {
        uniform token[] joints = ["a", "a/b"]
        uniform matrix4d[] bindTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]
        uniform matrix4d[] restTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]
        rel skel:animationSource = </Model/skeleton/move>
        double3 xformOp:translate = (0, 3, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def SkelAnimation "move" {
            uniform token[] joints = ["a", "a/b"]
            float3[] translations = [(0, 0, 0), (1, 0, 0)]
            quatf[] rotations.timeSamples = {
                1: [(1, 0, 0, 0), (1, 0, 0, 0)],
                3: [(1, 0, 0, 0), (0.8, 0, 0.6, 0)],
            }
            half3[] scales = [(1, 1, 1), (1, 2, 1)]
            uniform token[] blendShapes = ["bulge"]
            float[] blendShapeWeights = [0.5]
        }
    }
    def Mesh "mesh" (prepend apiSchemas = ["SkelBindingAPI"]) { QUAD
        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0.6, 0, 0.8), (0, 0, 1)]
        rel skel:skeleton = </Model/skeleton>
        matrix4d primvars:skel:geomBindTransform = (
            (1, 0, 0, 0), (0, 2, 0, 0), (0, 0, 1, 0), (0.25, 0, 0, 1))
        int[] primvars:skel:jointIndices = [0, 0, 0, 1, 1, 0, 0, 1] (
            elementSize = 2
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 0, 0.25, 0.75, 1, 0, 0.5, 0.5] (
            elementSize = 2
            interpolation = "vertex"
        )
        SHAPES
    }
}
"""
SHAPES = """
        uniform token[] skel:blendShapes = ["bulge"]
        rel skel:blendShapeTargets = </Model/mesh/bulge>
        def BlendShape "bulge" {
            uniform vector3f[] offsets = [(0, 0, 1), (0.5, 0, 0)]
            uniform int[] pointIndices = [1, 2]
        }
"""


def baked(path, frame: float) -> tuple[np.ndarray, np.ndarray]:
    """World points and normals that UsdSkel bakes."""
    stage = Usd.Stage.Open(str(path))
    stage.SetEditTarget(stage.GetSessionLayer())
    assert UsdSkel.BakeSkinning(UsdSkel.Root(stage.GetPrimAtPath("/Model")))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Model/mesh"))
    to_world = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(mesh.GetPrim()))
    points = np.array(mesh.GetPointsAttr().Get(frame)) @ to_world[:3, :3] + to_world[3, :3]
    normals = np.array(mesh.GetNormalsAttr().Get(frame)) @ np.linalg.inv(to_world[:3, :3]).T
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("shapes", ["", SHAPES])
@pytest.mark.parametrize("frame", [1, 3])
def test_skinned_points_and_normals_are_those_that_usd_bakes(write, shapes, frame):
    path = write(SKINNED.replace("SHAPES", shapes))
    mesh = load(path, frame=frame).meshes[0]
    expected_points, expected_normals = baked(path, frame)
    matrix = mesh.transform
    points = mesh.points @ matrix[:3, :3] + matrix[3, :3]
    assert points == pytest.approx(expected_points, abs=1e-5)
    normals = mesh.normals.values[mesh.normals.corners] @ np.linalg.inv(matrix[:3, :3]).T
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    assert normals == pytest.approx(expected_normals[mesh.triangles], abs=1e-5)


def test_the_rest_pose_differs_so_the_comparison_means_something(write):
    path = write(SKINNED.replace("SHAPES", ""))
    first, second = (load(path, frame=frame).meshes[0].points for frame in (1, 3))
    assert np.abs(first - second).max() > 0.1


def test_the_automatic_camera_frames_the_skinned_points(write):
    scene = load(write(SKINNED.replace("SHAPES", "")), frame=3)
    mesh, lens = scene.meshes[0], scene.camera.transform
    points = mesh.points @ mesh.transform[:3, :3] + mesh.transform[3, :3]
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    assert lens[3, :2] == pytest.approx(middle[:2], abs=1e-5)


def test_the_stage_is_not_edited(write):
    stage = Usd.Stage.Open(str(write(SKINNED.replace("SHAPES", SHAPES))))
    before = stage.ExportToString()
    load(stage, frame=3)
    assert stage.ExportToString() == before


def test_between_time_samples_joints_turn_evenly(write):
    """At 2.5 the second joint has turned three quarters of the way, by quaternions: as in a file
    that says so at that time."""
    body = SKINNED.replace("SHAPES", "")
    half = 0.75 * np.arctan2(0.6, 0.8)
    turned = f"2.5: [(1, 0, 0, 0), ({np.cos(half)}, 0, {np.sin(half)}, 0)], 3:"
    between = load(write(body), frame=2.5).meshes[0].points
    sampled = load(write(body.replace("3:", turned), name="b.usda"), frame=2.5).meshes[0].points
    assert between == pytest.approx(sampled, abs=1e-5)
    assert np.abs(between - load(write(body), frame=3).meshes[0].points).max() > 0.05


@pytest.mark.parametrize("frame", [1, 3])
def test_subdivision_surfaces_are_made_of_skinned_points(write, frame):
    """Bilinear ones keep their points: those that USD bakes."""
    body = SKINNED.replace("SHAPES", "").replace("normal3f[] normals", "normal3f[] unused")
    path = write(body)
    text = path.read_text().replace('subdivisionScheme = "none"', 'subdivisionScheme = "bilinear"')
    path.write_text(text)
    mesh = load(path, frame=frame, complexity="medium").meshes[0]
    stage = Usd.Stage.Open(str(path))
    stage.SetEditTarget(stage.GetSessionLayer())
    assert UsdSkel.BakeSkinning(
        UsdSkel.Root(stage.GetPrimAtPath("/Model")), Gf.Interval(frame, frame)
    )
    prim = stage.GetPrimAtPath("/Model/mesh")
    to_world = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(prim))
    baked_points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(frame))
    expected = baked_points @ to_world[:3, :3] + to_world[3, :3]
    points = mesh.points @ mesh.transform[:3, :3] + mesh.transform[3, :3]
    assert points[:4] == pytest.approx(expected, abs=1e-5)


SHUTTER = """
def Camera "camera" {
    double shutter:open = 0
    double shutter:close = 2
}
"""


@pytest.mark.parametrize("shapes", ["", SHAPES])
def test_skinned_meshes_move_while_the_shutter_is_open(write, shapes):
    """At every step the points and normals of a stage that is read at that time."""
    path = write(SKINNED.replace("SHAPES", shapes) + SHUTTER)
    still = write(SKINNED.replace("SHAPES", shapes), name="still.usda")
    (mesh,) = load(path, frame=1).meshes
    assert 2 <= len(mesh.motion) <= 16  # the second joint turns by 74 degrees
    shapes_at = [(mesh.points, mesh.normals.values, mesh.transform)]
    shapes_at += [(step.points, step.normals, step.transform) for step in mesh.motion]
    for index, (points, normals, transform) in enumerate(shapes_at):
        (expected,) = load(still, frame=1 + 2 * index / len(mesh.motion)).meshes
        np.testing.assert_allclose(points, expected.points, atol=1e-6)
        np.testing.assert_allclose(normals, expected.normals.values, atol=1e-6)
        np.testing.assert_allclose(transform, expected.transform)
