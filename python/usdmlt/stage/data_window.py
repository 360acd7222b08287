"""The part of a picture that is rendered."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from usdmlt.errors import UsageError
from usdmlt.scene import Camera

WHOLE = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True)
class DataWindow:
    """Pixels of a picture of ``full_width`` x ``full_height``: from column ``x`` and row ``y``,
    counted from its upper left corner, ``width`` x ``height`` of them."""

    x: int
    y: int
    width: int
    height: int
    full_width: int
    full_height: int


def data_window(
    ndc: tuple[float, float, float, float], full_width: int, full_height: int
) -> DataWindow:
    """The pixels whose centres are in (xmin, ymin, xmax, ymax), (0, 0) being the lower left corner
    and (1, 1) the upper right one (UsdRenderSettingsBase, dataWindowNDC); it may reach beyond the
    picture. Raises ValueError where there are none.
    """

    def first_centre(edge: float, pixels: int) -> int:
        return math.ceil(edge * pixels - 0.5 - 1e-6)  # float attributes: 0.7 is 0.69999999

    x0, x1 = first_centre(ndc[0], full_width), first_centre(ndc[2], full_width)
    y0, y1 = first_centre(ndc[1], full_height), first_centre(ndc[3], full_height)
    if not (x1 > x0 and y1 > y0):
        raise UsageError(f"no pixel of {full_width} x {full_height} is in the window {tuple(ndc)}")
    return DataWindow(x0, full_height - y1, x1 - x0, y1 - y0, full_width, full_height)


def windowed(camera: Camera, window: DataWindow) -> Camera:
    """The camera that sees the window's pixels alone."""
    left, right, bottom, top = camera.window
    pixel_width = (right - left) / window.full_width
    pixel_height = (top - bottom) / window.full_height
    left += window.x * pixel_width
    top -= window.y * pixel_height
    right, bottom = left + window.width * pixel_width, top - window.height * pixel_height
    return replace(camera, window=(left, right, bottom, top))
