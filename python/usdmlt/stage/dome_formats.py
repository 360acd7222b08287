"""Dome textures of other layouts than latitude and longitude, resampled to that.

UsdLux names the layouts and leaves their orientation open. Here the middle of every image is what a
viewer in the dome's middle sees along +z, with +y up and -x to the right, as in the middle of a
lat-long image; so the layouts show the same surroundings:

* ``angular``: the angle from the middle is proportional to the distance from it, 180 degrees at the
  inscribed circle (Debevec's light probes).
* ``mirroredBall``: the distance is the sine of half the angle: a picture of a mirroring sphere from
  far away.
* ``cubeMapVerticalCross``: three by four faces; the middle one of the second row is ahead, above
  and below it are up and down, beside it left and right, and the lowest, upside down, is behind.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

LATLONG = "latlong"


def layout(name: str | None, width: int, height: int) -> str:
    """The layout that a texture's ``texture:format`` means; ``automatic`` goes by its shape."""
    if name in (None, "", "automatic"):
        return "cubeMapVerticalCross" if 4 * width == 3 * height else LATLONG
    return str(name)


def to_latlong(pixels: np.ndarray, name: str) -> np.ndarray:
    """(height, width, channels) linear floats of a layout of :data:`LAYOUTS`, as lat-long."""
    rows, size = _resolution(pixels, name)
    t = (np.arange(rows) + 0.5) / rows * np.pi
    s = (np.arange(2 * rows) + 0.5) / (2 * rows)
    longitude = (0.5 - s) * 2 * np.pi  # from +z towards +x
    sine, cosine = np.sin(t)[:, None], np.cos(t)[:, None]
    x = sine * np.sin(longitude)
    z = sine * np.cos(longitude)
    y = np.broadcast_to(cosine, x.shape)
    # To the right, up and ahead, for the viewer of the image.
    column, row = LAYOUTS[name](-x, y, z, size)
    return _bilinear(pixels, column * size[0] - 0.5, row * size[1] - 0.5)


def _resolution(pixels: np.ndarray, name: str) -> tuple[int, tuple[int, int]]:
    """Rows that lose little of the image, and its (width, height)."""
    height, width = pixels.shape[:2]
    faces = height // 2 if name == "cubeMapVerticalCross" else height
    return max(faces, 2), (width, height)


# Directions (right, up, ahead) to the place in an image of some (width, height), (0, 0) to (1, 1)
# from its upper left.
Size = tuple[int, int]
Place = tuple[np.ndarray, np.ndarray]


def _angular(right: np.ndarray, up: np.ndarray, ahead: np.ndarray, _: Size) -> Place:
    across = np.hypot(right, up)
    radius = np.arctan2(across, ahead) / np.pi
    scale = np.divide(radius, across, out=np.zeros_like(across), where=across > 0)
    return 0.5 + 0.5 * right * scale, 0.5 - 0.5 * up * scale


def _mirrored_ball(right: np.ndarray, up: np.ndarray, ahead: np.ndarray, _: Size) -> Place:
    across = np.hypot(right, up)
    radius = np.sin(np.arctan2(across, ahead) / 2)
    scale = np.divide(radius, across, out=np.zeros_like(across), where=across > 0)
    return 0.5 + 0.5 * right * scale, 0.5 - 0.5 * up * scale


def _vertical_cross(right: np.ndarray, up: np.ndarray, ahead: np.ndarray, size: Size) -> Place:
    largest = np.maximum(np.maximum(abs(right), abs(up)), abs(ahead))
    # Of each face: its place in the cross, and the coordinates to its right and upwards.
    faces = [
        (ahead == largest, 1, 1, right, up),
        (-ahead == largest, 1, 3, right, -up),
        (right == largest, 2, 1, -ahead, up),
        (-right == largest, 0, 1, ahead, up),
        (up == largest, 1, 0, right, -ahead),
        (-up == largest, 1, 2, right, ahead),
    ]
    column, row = np.zeros_like(largest), np.zeros_like(largest)
    for inside, across, down, u, v in faces:
        # Not beyond the centres of the outer texels: beside them is another face, or nothing.
        u = np.clip(u / largest, 3 / size[0] - 1, 1 - 3 / size[0])
        v = np.clip(v / largest, 4 / size[1] - 1, 1 - 4 / size[1])
        column = np.where(inside, (across + 0.5 + 0.5 * u) / 3, column)
        row = np.where(inside, (down + 0.5 - 0.5 * v) / 4, row)
    return column, row


LAYOUTS: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray, Size], Place]] = {
    "angular": _angular,
    "mirroredBall": _mirrored_ball,
    "cubeMapVerticalCross": _vertical_cross,
}


def _bilinear(pixels: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Texels at (x, y), whole numbers being their centres; the border repeats."""
    height, width = pixels.shape[:2]
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    fx, fy = (x - left)[..., None], (y - top)[..., None]
    upper = pixels[top, left] * (1 - fx) + pixels[top, right] * fx
    lower = pixels[bottom, left] * (1 - fx) + pixels[bottom, right] * fx
    return (upper * (1 - fy) + lower * fy).astype(np.float32)
