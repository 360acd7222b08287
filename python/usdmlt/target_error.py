"""Renders that end when their error is small enough.

The error is looked at when certain numbers of units are done, which the plan fixes: the picture is
then the same on every machine, in one go or resumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from usdmlt.color.spaces import LUMINANCE

if TYPE_CHECKING:
    from usdmlt.rendering import Rendering

# Samples, or mutations, per pixel before the first look: of fewer, an error tells little.
FIRST_LOOK = {"path": 16, "bdpt": 16, "mlt": 32}
FEWEST_UNITS = 32  # which tell the error of splats to an eighth
GROWTH = 1.1  # from look to look


@dataclass(frozen=True)
class Look:
    """What a look at the error told. ``units``: how many were done; ``units_needed``: with how
    many the error will be small enough, the same where it is already."""

    units: int
    units_needed: int

    @property
    def is_reached(self) -> bool:
        """Whether the error is small enough."""
        return self.units_needed == self.units


def relative_error(rendering: Rendering) -> float:
    """sqrt(mean(e^2 / (R^2 + 0.01 mean(R)^2))) of the pixels' errors e and luminances R.

    Infinite where nothing is done, or all is black.
    """
    if rendering.units_done == 0:
        return math.inf
    luminance = rendering.rgba()[..., :3].astype(np.float64) @ LUMINANCE
    mean = luminance.mean()
    if not mean > 0:
        return math.inf
    squares = rendering.error().astype(np.float64) ** 2 / (luminance**2 + 0.01 * mean**2)
    return float(np.sqrt(squares.mean()))


def look(rendering: Rendering) -> Look | None:
    """A look, if the render has done the number of units of one.

    The error falls like 1/sqrt(units): of n units with the error e, a target t needs n (e/t)^2. It
    is reached at the look that comes next then.
    """
    target, units = rendering.settings.target_error, rendering.units
    if target is None or len(units) != 1 or units[0][0] != 0:
        return None
    done = units[0][1]
    if _next_look(rendering, done - 1) != done:
        return None
    error = relative_error(rendering)
    if error <= target:
        return Look(done, done)
    if math.isinf(error):
        return None  # all is black yet
    excess = error / target
    needed = math.ceil(min(done * excess * excess, rendering.units_total))
    return Look(done, _next_look(rendering, max(needed - 1, done)))


def next_look(rendering: Rendering, first: int, last: int) -> int:
    """Where units from ``first`` to ``last`` are interrupted to look at the error."""
    if rendering.settings.target_error is None:
        return last
    return min(_next_look(rendering, first), last)


def _next_look(rendering: Rendering, done: int) -> int:
    """The least number of units above ``done`` at which there is a look."""
    pixels = rendering.scene.width * rendering.scene.height
    samples = FIRST_LOOK[rendering.integrator] * pixels
    look = max(math.ceil(samples / max(rendering.samples_per_unit, 1.0)), FEWEST_UNITS)
    while look <= done:
        look = max(math.ceil(look * GROWTH), look + 1)
    return look
