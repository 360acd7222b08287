"""Frames to render and the files they go to, as usdrecord has them."""

from __future__ import annotations

import math
import re
from pathlib import Path

from usdmlt.errors import UsageError

MOST_FRAMES = 1_000_000  # more are a slip of the keyboard, and would fill the memory

# One run of #, or two with a dot between them: width, and digits after the dot.
_PLACEHOLDER = re.compile(r"#+(?:\.#+)?")


def parse_frames(specification: str) -> list[float]:
    """Time codes of ``start[:end[xstride]]``, several separated by commas; ValueError otherwise.

    >>> parse_frames("1:3,10,5:4x-0.5")
    [1.0, 2.0, 3.0, 10.0, 5.0, 4.5, 4.0]
    """
    from pxr import Tf, UsdUtils

    frames: list[float] = []
    for part in specification.split(","):
        try:
            codes = UsdUtils.TimeCodeRange.CreateFromFrameSpec(part.strip())
        except Tf.ErrorException:
            codes = None
        if codes is None or not codes.IsValid():
            raise UsageError(
                f"frames {part!r} is not start[:end[xstride]], such as 101, 101:105, 101:109x2"
            )
        span = codes.endTimeCode.GetValue() - codes.startTimeCode.GetValue()
        if len(frames) + span / codes.stride > MOST_FRAMES:
            raise UsageError(f"frames {part!r} are more than {MOST_FRAMES}")
        frames.extend(code.GetValue() for code in codes)
    return frames


def check_placeholder(path: str, frames: list[float] | None) -> None:
    """Raise ValueError unless ``path`` has a ``###`` exactly if ``frames`` are given."""
    found = _PLACEHOLDER.findall(Path(path).name)
    if frames is None:
        if found:
            raise UsageError(
                f"{path} has a {found[0]} for the frame number, but no --frames is given"
            )
        return
    if len(found) != 1:
        raise UsageError(
            f"{path} needs one placeholder for the frame number, such as shot.####.exr"
            if not found
            else f"{path} has more than one placeholder for the frame number"
        )
    for frame in frames:
        # Strides such as 0.1 do not end on decimals to the last bit.
        if not math.isclose(float(_number(found[0], frame)), frame, rel_tol=1e-12, abs_tol=1e-9):
            raise UsageError(
                f"{found[0]} cannot show frame {frame:g}: ask for digits after a dot, "
                "such as shot.###.##.exr"
            )


def frame_path(path: str, frame: float) -> str:
    """The path with its placeholder replaced by the frame number.

    The placeholder's length, dot included, is the least width; the # after its dot are decimals.

    >>> frame_path("shot.###.exr", 7.0)
    'shot.007.exr'
    >>> frame_path("shot.###.##.exr", 7.5)
    'shot.007.50.exr'
    """
    target = Path(path)
    return str(target.with_name(_PLACEHOLDER.sub(lambda m: _number(m.group(), frame), target.name)))


def _number(placeholder: str, frame: float) -> str:
    decimals = len(placeholder.partition(".")[2])
    return f"{frame:0{len(placeholder)}.{decimals}f}"
