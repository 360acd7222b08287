"""How fine curved surfaces are made: a fixed level, or until an edge is as long as two pixels."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from usdmlt.scene import Camera

# usdrecord's complexities 1.0 to 1.3 are refinement levels 0 to 3.
COMPLEXITIES = {"low": 0, "medium": 1, "high": 2, "veryhigh": 3}

PIXELS = 2.0  # length of an edge
# Triangles that a surface is refined to at most, unless the level is fixed: so many, and no more
# than a share of what is left of a budget for all surfaces of the scene.
LARGEST = 1 << 20
BUDGET = 1 << 25
SHARE = 8


@dataclass
class Budget:
    """Triangles that may still be made."""

    left: int


@dataclass
class Detail:
    """How large things are in the picture, and so how fine they have to be.

    ``fixed``: the level whatever the size, or None. ``pixel``: a pixel's size at distance 1 from
    ``eye``, or anywhere before an orthographic camera (``eye`` None). The mesh at hand is at
    ``local`` (4, 4) in a group that is ``placements`` (n, 4, 4) in the world.
    """

    fixed: int | None = None
    eye: np.ndarray | None = None
    pixel: float = 0.0
    local: np.ndarray = field(default_factory=lambda: np.eye(4))
    placements: np.ndarray = field(default_factory=lambda: np.eye(4)[None])
    budget: Budget = field(default_factory=lambda: Budget(BUDGET))

    @classmethod
    def of(cls, complexity: str | None, camera: Camera, width: int) -> Detail:
        """For a picture ``width`` pixels wide; ``complexity`` None: by size."""
        left, right = camera.window[:2]
        eye = camera.transform[3, :3].copy() if camera.projection == "perspective" else None
        fixed = None if complexity is None else COMPLEXITIES[complexity]
        return cls(fixed, eye, abs(right - left) / width)

    def placed(self, local: np.ndarray, placements: np.ndarray) -> Detail:
        """The same for another mesh."""
        return Detail(self.fixed, self.eye, self.pixel, local, placements, self.budget)

    def level(self, points: np.ndarray, cage) -> int:
        """The level at which the root mean square length of the edges of a cage, its vertices at
        ``points`` (n, 3), is two pixels; their squares add up to about the area in the picture, and
        so does the number of triangles."""
        if self.fixed is not None:
            return self.fixed
        if not cage.edge_count or self.pixel <= 0:
            return 0
        pixels = cage.edge_pixels(points, self._nearest(points), self.eye, self.pixel)
        if not math.isfinite(pixels):  # beyond all numbers, and not to be seen
            return 0
        level = math.ceil(math.log2(max(pixels / PIXELS, 1.0)))
        largest = min(LARGEST, self.budget.left // SHARE)
        triangles = 2 * cage.corner_count  # of level 1
        level = min(level, int(math.log(max(largest / triangles, 1), 4)) + 1)
        self.budget.left = max(self.budget.left - triangles * 4 ** max(level - 1, 0), 0)
        return level

    def pixels(self, points: np.ndarray, length: float) -> float:
        """How many pixels a length among ``points`` (n, 3) has where it looks largest."""
        if self.pixel <= 0:
            return math.inf
        transform = self._nearest(points)
        scale = _scale(transform)
        if self.eye is None:
            return length * scale / self.pixel
        at = points.astype(np.float64) @ transform[:3, :3] + transform[3, :3]
        distance = float(np.linalg.norm(at - self.eye, axis=1).min())
        pixels = length * scale / (self.pixel * max(distance, length * scale))
        return 0.0 if math.isnan(pixels) else pixels  # beyond all numbers, and not to be seen

    def _nearest(self, points: np.ndarray) -> np.ndarray:
        """The transform to the world in which the points look largest."""
        placements = self.placements
        if len(placements) == 1:
            return self.local @ placements[0]
        scale = _scale(placements)
        if self.eye is not None:
            low, high = points.min(axis=0), points.max(axis=0)
            center = (low + high) / 2 @ self.local[:3, :3] + self.local[3, :3]
            radius = _scale(self.local) * np.linalg.norm(high - low) / 2
            at = center @ placements[:, :3, :3] + placements[:, 3, :3]
            distance = np.linalg.norm(at - self.eye, axis=1)
            scale = scale / np.maximum(distance, radius * scale)
        return self.local @ placements[int(np.argmax(scale))]


@dataclass
class SteadyDetail(Detail):
    """Answers as it did the first time: for the same thing at other times.

    Its shape may change its size then, but not its triangles.
    """

    def __post_init__(self) -> None:
        self._answers: list[float] = []
        self._next: int | None = None

    def again(self) -> None:
        """What is asked from here on was asked before, in the same order."""
        self._next = 0

    def _answer(self, new: Callable[[], float]) -> float:
        if self._next is None or self._next == len(self._answers):
            self._answers.append(new())
            return self._answers[-1]
        self._next += 1
        return self._answers[self._next - 1]

    def level(self, points: np.ndarray, cage) -> int:
        return int(self._answer(lambda: super(SteadyDetail, self).level(points, cage)))

    def pixels(self, points: np.ndarray, length: float) -> float:
        return self._answer(lambda: super(SteadyDetail, self).pixels(points, length))


def _scale(transforms: np.ndarray) -> np.ndarray:
    """The longest row of (..., 4, 4): about how much larger things become."""
    return np.sqrt(np.square(transforms[..., :3, :3]).sum(axis=-1).max(axis=-1))
