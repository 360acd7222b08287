"""Motion of point instances and of points: samples, velocities, accelerations, spins."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Report
from usdmlt.stage.motion import Shutter, composed
from usdmlt.stage.points import read_spheres, sphere_transforms
from usdmlt.stage.traversal import Placed

MOVING = (
    "positions",
    "orientations",
    "orientationsf",
    "scales",
    "velocities",
    "accelerations",
    "angularVelocities",
)
VELOCITIES = ("velocities", "accelerations", "angularVelocities")


def placed_motion(
    transforms: np.ndarray, own: np.ndarray | None, placed: Placed
) -> np.ndarray | None:
    """The motion (times, n, 4, 4) in the group of the instances of a prim; None if they stay."""
    outer = None if placed.motion is None else placed.motion[:, None]
    return composed(transforms, own, placed.matrix[None], outer)


def instance_motion(
    instancer: UsdGeom.PointInstancer, count: int, shutter: Shutter, report: Report
) -> np.ndarray | None:
    """Transforms (times, count, 4, 4) of point instances in the instancer's space, as
    UsdGeomPointInstancer computes them from samples or, where there are any, velocities (units and
    degrees per second)."""
    if not _varies(instancer.GetPrim(), MOVING):
        return None
    found = instancer.ComputeInstanceTransformsAtTimes(
        shutter.codes,
        shutter.frame,
        UsdGeom.PointInstancer.ExcludeProtoXform,
        UsdGeom.PointInstancer.IgnoreMask,
    )
    motion = [np.array(matrices, dtype=np.float64).reshape(-1, 4, 4) for matrices in found]
    return _complete(motion, count, len(shutter.times), instancer.GetPath(), report)


def sphere_motion(
    prim: Usd.Prim, count: int, shutter: Shutter, report: Report
) -> np.ndarray | None:
    """The same for the spheres of UsdGeomPoints: (times, count, 4, 4)."""
    if not _varies(prim, ("points", "widths", "primvars:widths", "velocities", "accelerations")):
        return None
    read = [read_spheres(prim, code, Report(), shutter.frame) for code in shutter.codes]
    motion = [sphere_transforms(*spheres) for spheres in read if spheres is not None]
    return _complete(motion, count, len(shutter.times), prim.GetPath(), report)


def _varies(prim: Usd.Prim, names: tuple[str, ...]) -> bool:
    for name in names:
        attribute = prim.GetAttribute(name)
        if not attribute or not attribute.HasAuthoredValue():
            continue
        if name in VELOCITIES or attribute.ValueMightBeTimeVarying():
            return True
    return False


def _complete(
    motion: list[np.ndarray], count: int, times: int, path, report: Report
) -> np.ndarray | None:
    if len(motion) != times or any(len(transforms) != count for transforms in motion):
        report.warn("motion that changes the number of points or faces is not rendered", path)
        return None
    result = np.array(motion)
    if not np.isfinite(result).all():
        report.warn("motion that is not finite is not rendered", path)
        return None
    return result
