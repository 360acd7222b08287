"""The camera of a stage that has none: it frames everything, as usdrecord does."""

from __future__ import annotations

import math

import numpy as np
from pxr import Gf, Usd, UsdGeom

from usdmlt.scene import Camera, Instances, Mesh, Prototype

Bounds = tuple[np.ndarray, np.ndarray]  # the low and the high corner of a box


def framing_camera(bounds: Bounds, up_axis: str) -> Camera:
    """A 50 mm camera that sees the whole of a box.

    The box's side towards the camera fits the horizontal field of view: with r half the
    side's diagonal and d half the depth, the distance is r / tan(fov / 2) + d (UsdAppUtils'
    frame recorder), plus the near clipping distance where it is less than that. Unlike usdrecord's,
    it stands back further where what is tall would be cut off. It looks along -z, or along +y where
    z is up.
    """
    lens = Gf.Camera()
    low, high = bounds
    center, size = (low + high) / 2, high - low
    depth_axis, rise_axis = (2, 1) if up_axis == "Y" else (1, 2)
    radius = math.hypot(size[0], size[rise_axis]) / 2
    half_view = math.radians(lens.GetFieldOfView(Gf.Camera.FOVHorizontal)) / 2
    distance = radius / math.tan(half_view) + size[depth_axis] / 2
    half_rise = math.radians(lens.GetFieldOfView(Gf.Camera.FOVVertical)) / 2
    to_fit_height = 1.05 * size[rise_axis] / 2 / math.tan(half_rise) + size[depth_axis] / 2
    distance = max(distance, to_fit_height)
    near = lens.clippingRange.min
    if distance < near:
        distance += near
    distance = float(distance)
    transform = np.eye(4)
    if up_axis == "Y":
        transform[3, :3] = center + np.array([0.0, 0.0, distance])
    else:
        transform[:3, :3] = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
        transform[3, :3] = center + np.array([0.0, -distance, 0.0])
    half_width = lens.horizontalAperture / lens.focalLength / 2
    half_height = lens.verticalAperture / lens.focalLength / 2
    return Camera(
        transform=transform,
        window=(-half_width, half_width, -half_height, half_height),
        focus_distance=distance,
        name="",
    )


def stage_bounds(stage: Usd.Stage, time: Usd.TimeCode, purposes: tuple[str, ...]) -> Bounds | None:
    """The world box of a stage from its extents and extent hints; None if it is empty or broken."""
    cache = UsdGeom.BBoxCache(time, list(purposes), useExtentsHint=True)
    box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    if box.IsEmpty():
        return None
    low, high = np.array(box.GetMin()), np.array(box.GetMax())
    extreme = np.finfo(np.float32).max / 2
    return (low, high) if np.abs([low, high]).max() < extreme else None


def scene_bounds(
    meshes: list[Mesh], prototypes: list[Prototype], instances: list[Instances]
) -> Bounds | None:
    """The world box of what is rendered; None if there is nothing."""
    corners = [_box_corners(mesh) @ mesh.transform for mesh in meshes]
    for placed in instances:
        for mesh in prototypes[placed.prototype].meshes:
            local = _box_corners(mesh) @ mesh.transform
            corners.append((local @ placed.transforms).reshape(-1, 4))
    if not corners:
        return None
    points = np.concatenate(corners)[:, :3]
    return points.min(axis=0), points.max(axis=0)


def _box_corners(mesh: Mesh) -> np.ndarray:
    """(8, 4) homogeneous corners of a mesh's local box."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    choice = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
    return np.concatenate([np.where(choice, high, low), np.ones((8, 1))], axis=1)
