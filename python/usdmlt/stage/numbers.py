"""Numbers that a file may have got wrong."""

from __future__ import annotations

import math

from pxr import Usd

from usdmlt.errors import Error


def finite_number(prim: Usd.Prim, name: str, value: object) -> float:
    """``value`` as a float; :class:`Error` with the prim and the attribute if it is none."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise Error(f"{prim.GetPath()}: {name} is {value}, not a number")
    return number
