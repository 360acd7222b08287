"""Lights where their prims are, and where those are carried while the shutter is open.

A light keeps the shape that it has at the frame, normalization included: it is turned and moved as
its prim is. What else its transform does is taken away from each step by polar decomposition.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from usdmlt.errors import Report
from usdmlt.scene import DistantLight, DomeLight, Light
from usdmlt.stage.motion import composed, every, fewest_steps
from usdmlt.stage.transforms import singular
from usdmlt.stage.traversal import Placed, Placements

RIGID = 1e-3  # how much of a stretch is none


def place_light(
    light: Light, placed: Placed, placements: Placements, report: Report
) -> list[Light]:
    """A light of a group, read where it is in the group, in each of the group's placements."""
    outer = placements.transforms
    own = None if placed.motion is None else placed.motion[:, None]
    motion = composed(placed.matrix[None], own, outer, placements.motion)
    lights = [replace(light, transform=light.transform @ transform) for transform in outer]
    if motion is None:
        return lights
    frames = placed.matrix @ outer
    return [
        _carried(light, frame, motion[:, index], placed, report)
        for index, (light, frame) in enumerate(zip(lights, frames, strict=True))
    ]


def _carried(
    light: Light, frame: np.ndarray, motion: np.ndarray, placed: Placed, report: Report
) -> Light:
    """The light at the transforms ``motion`` (times, 4, 4) of its prim, instead of at ``frame``."""
    if singular(motion).any() or singular(frame):
        report.warn(
            "motion through transforms that are singular is not rendered", placed.prim.GetPath()
        )
        return light
    left, stretch, right = np.linalg.svd(np.linalg.inv(frame[:3, :3]) @ motion[:, :3, :3])
    if np.abs(stretch - 1).max() > RIGID:
        report.warn("lights keep the size they have at the frame", placed.prim.GetPath())
    transforms = np.tile(light.transform, (len(motion), 1, 1))
    transforms[:, :3, :3] = light.transform[:3, :3] @ (left @ right)
    if not isinstance(light, (DistantLight, DomeLight)):
        transforms[:, 3, :3] = motion[:, 3, :3]
    steps = fewest_steps(transforms)
    if steps == 0:
        return light
    first, *later = every(transforms, steps)
    return replace(light, transform=first, motion=later)
