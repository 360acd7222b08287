"""Renders that end when their error is small enough.

The error is looked at when certain numbers of units are done, which the plan fixes: the picture is
then the same on every machine, in one go or resumed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from usdmlt.color.spaces import LUMINANCE

if TYPE_CHECKING:
    from usdmlt.rendering import Rendering

# Samples, or mutations, per pixel before the first look: of fewer, an error tells little.
FIRST_LOOK = {"path": 16, "bdpt": 16, "mlt": 32}
FEWEST_UNITS = 32  # which tell the error of splats to an eighth
GROWTH = 1.1  # from look to look


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


def is_reached(rendering: Rendering) -> bool:
    """Whether the render has done the number of units of a look, and its error is small enough."""
    target, units = rendering.settings.target_error, rendering.units
    if target is None or len(units) != 1 or units[0][0] != 0:
        return False
    done = units[0][1]
    return _next_look(rendering, done - 1) == done and relative_error(rendering) <= target


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
