"""What moves while a camera's shutter is open: when it is looked at, and in how few steps.

Everything is looked at at the same equidistant times, 2^k + 1 of them. What moves keeps every
second, fourth, … of them, as long as straight lines between those come close to the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Report
from usdmlt.scene import Instances, Mesh, MeshStep, Primvar
from usdmlt.stage.transforms import singular

STEPS = 16  # of a shutter open for up to four frames
MOST_STEPS = 128  # Embree has room for 129 times
STRAIGHT = 1e-3  # how far a path may be off a line, as a fraction of its size


@dataclass(frozen=True)
class Shutter:
    """``times`` (2^k + 1,): time codes from opening to closing; empty where nothing is blurred.
    ``frame``: the time that is rendered."""

    frame: Usd.TimeCode
    times: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def opens(self) -> bool:
        return len(self.times) > 0

    def scaled(self, scale: float) -> Shutter:
        """Open ``scale`` times as far from the frame, which blurs so much more; 0: not at all."""
        if scale == 1 or not self.opens:
            return self
        if scale == 0:
            return Shutter(self.frame)
        frame = self.frame.GetValue()
        return Shutter(self.frame, frame + scale * (self.times - frame))

    @property
    def codes(self) -> list[Usd.TimeCode]:
        return [Usd.TimeCode(float(time)) for time in self.times]


def read_shutter(
    camera: UsdGeom.Camera | None, frame: Usd.TimeCode, blurs: bool, report: Report
) -> Shutter:
    """When a camera's shutter is open: shutter:open and shutter:close are time codes relative to
    the frame (UsdGeomCamera). One that closes no later than it opens blurs nothing."""
    if camera is None or not blurs:
        return Shutter(frame)
    opening, closing = (
        float(attribute.Get(frame) or 0.0)
        for attribute in (camera.GetShutterOpenAttr(), camera.GetShutterCloseAttr())
    )
    if not closing > opening or not np.isfinite(closing - opening):
        return Shutter(frame)
    if not frame.IsNumeric() or frame.IsEarliestTime():
        report.note("shutters open at frames: no frame is rendered", camera.GetPath())
        return Shutter(frame)
    steps = STEPS
    while steps < min(4 * (closing - opening), MOST_STEPS):
        steps *= 2
    middle = frame.GetValue()
    return Shutter(frame, np.linspace(middle + opening, middle + closing, steps + 1))


# -- steps


def _misses(values: np.ndarray, steps: int) -> np.ndarray:
    """How far ``values`` (2^k + 1, …) are from lines between every 2^k / ``steps`` of them."""
    last = len(values) - 1
    kept = values[:: last // steps]
    position = np.arange(last + 1) * steps / last
    first = np.minimum(position.astype(int), steps - 1)
    fraction = (position - first).reshape(-1, *[1] * (values.ndim - 1))
    return np.abs(kept[first] * (1 - fraction) + kept[first + 1] * fraction - values)


def straight(values: np.ndarray, steps: int) -> bool:
    """Whether points (2^k + 1, n, 3) run straight between every 2^k / ``steps`` of them."""
    size = np.abs(values - values[0]).max(initial=0.0)
    rounding = 1e-6 * np.abs(values).max(initial=0.0)
    return bool(_misses(values, steps).max(initial=0.0) <= STRAIGHT * size + rounding)


def fewest_steps(transforms: np.ndarray) -> int:
    """In how many steps (2^k + 1, …, 4, 4) matrices move almost as they do; 0: they stay."""
    linear, place = transforms[..., :3, :3], transforms[..., 3, :3]
    turned = np.abs(linear - linear[0]).max(initial=0.0) > 1e-9 * np.abs(linear).max(initial=0.0)
    moved = np.abs(place - place[0]).max(initial=0.0) > 1e-9 * np.abs(place).max(initial=0.0)
    if not (turned or moved):
        return 0
    steps = 1
    size = np.abs(linear).max(initial=0.0)
    while steps < len(transforms) - 1:
        if straight(place, steps) and _misses(linear, steps).max(initial=0.0) <= STRAIGHT * size:
            break
        steps *= 2
    return steps


def every(values: np.ndarray, steps: int) -> np.ndarray:
    """``steps`` + 1 of 2^k + 1 values."""
    return values[:: (len(values) - 1) // steps]


# -- motion of placements


def stacked(transforms: np.ndarray, motions: Sequence[np.ndarray | None]) -> np.ndarray | None:
    """The motion (times, n, 4, 4) of things that are at ``transforms`` (n, 4, 4) unless they have
    a motion (times, 4, 4) of their own; None where none of them has."""
    times = next((len(motion) for motion in motions if motion is not None), 0)
    if not times:
        return None
    result = np.repeat(transforms[None], times, axis=0)
    for index, motion in enumerate(motions):
        if motion is not None:
            result[:, index] = motion
    return result


def composed(
    inner: np.ndarray,
    inner_motion: np.ndarray | None,
    outer: np.ndarray,
    outer_motion: np.ndarray | None,
) -> np.ndarray | None:
    """The motion (times, m n, 4, 4) of n inner placements in each of m outer ones."""
    if inner_motion is None and outer_motion is None:
        return None
    inside = inner[None] if inner_motion is None else inner_motion
    outside = outer[None] if outer_motion is None else outer_motion
    product = inside[:, None] @ outside[:, :, None]
    return product.reshape(len(product), -1, 4, 4)


# -- what the core gets


def settled(
    mesh: Mesh, placement: np.ndarray | None = None, motion: np.ndarray | None = None
) -> Mesh:
    """A mesh as it is when the shutter opens, with the later steps of its motion.

    ``mesh.motion``: of its own, the opening first. ``placement`` (4, 4) and its ``motion``
    (times, 4, 4): of the group the mesh is in.
    """
    count = 0 if motion is None else fewest_steps(motion)
    steps = mesh.motion
    if not steps and not count:
        return mesh if placement is None else replace(mesh, transform=mesh.transform @ placement)
    if not steps:
        values = None if mesh.normals is None else mesh.normals.values
        steps = [MeshStep(mesh.points, values, mesh.transform)]
    steps = _resampled(steps, max(count, len(steps) - 1))
    if count:
        outer = every(motion, len(steps) - 1)
        steps = [replace(s, transform=s.transform @ m) for s, m in zip(steps, outer, strict=True)]
    elif placement is not None:
        steps = [replace(s, transform=s.transform @ placement) for s in steps]
    first, *later = steps
    normals = None if mesh.normals is None else Primvar(first.normals, mesh.normals.corners)
    return replace(
        mesh, points=first.points, normals=normals, transform=first.transform, motion=later
    )


def carried(mesh: Mesh, motion: np.ndarray) -> Mesh:
    """A mesh that keeps its shape, moved by (times, 4, 4) in its group; the opening first."""
    count = fewest_steps(motion)
    values = None if mesh.normals is None else mesh.normals.values
    steps = [MeshStep(mesh.points, values, matrix) for matrix in every(motion, max(count, 1))]
    return replace(mesh, motion=steps if count else [])


def _resampled(steps: list[MeshStep], count: int) -> list[MeshStep]:
    """``count`` + 1 steps; ``count`` is a multiple of how many there were, or there was none."""
    if len(steps) == 1:
        return steps * (count + 1)
    result = []
    for index in range(count + 1):
        whole, part = divmod(index * (len(steps) - 1), count)
        if part == 0:
            result.append(steps[whole])
            continue
        a, b, f = steps[whole], steps[whole + 1], part / count
        normals = None if a.normals is None else a.normals * (1 - f) + b.normals * f
        points = (a.points * (1 - f) + b.points * f).astype(np.float32)
        result.append(MeshStep(points, normals, a.transform * (1 - f) + b.transform * f))
    return result


def moving_instances(
    prototype: int, transforms: np.ndarray, motion: np.ndarray | None, name: str, report: Report
) -> list[Instances]:
    """Placements of a prototype; those that move (``motion``: (times, n, 4, 4)) apart."""
    if motion is None:
        return [Instances(prototype, transforms, name=name)]
    broken = singular(motion).any(axis=0)
    if broken.any():
        report.warn("motion through transforms that are singular is not rendered", name)
    moves = (np.abs(motion - motion[0]).max(axis=(0, 2, 3)) > 0) & ~broken
    result = []
    if not moves.all():
        result.append(Instances(prototype, transforms[~moves], name=name))
    if moves.any():
        moving = motion[:, moves]
        moving = every(moving, max(fewest_steps(moving), 1))
        result.append(Instances(prototype, moving[0], name=name, motion=moving[1:]))
    return result
