"""Sets of numbered work units: sorted ranges (first, one beyond the last), as the core has them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from usdmlt.errors import UsageError

Range = tuple[int, int]


def gaps(wanted: Range, done: Sequence[Range]) -> list[Range]:
    """What of ``wanted`` is not in ``done``, whose ranges are disjoint and ascending.

    >>> gaps((0, 10), [(2, 4), (8, 12)])
    [(0, 2), (4, 8)]
    """
    missing = []
    first, last = wanted
    for start, end in done:
        if first < min(start, last):
            missing.append((first, min(start, last)))
        first = max(first, end)
    if first < last:
        missing.append((first, last))
    return missing


def joined(ranges: Iterable[Range]) -> list[Range]:
    """The same set, sorted and without neighbours. Ranges must not overlap."""
    result: list[Range] = []
    for first, last in sorted((int(first), int(last)) for first, last in ranges):
        if result and result[-1][1] == first:
            result[-1] = (result[-1][0], last)
        elif first < last:
            result.append((first, last))
    return result


def count(ranges: Iterable[Range]) -> int:
    """How many units."""
    return sum(last - first for first, last in ranges)


def overlap(a: Sequence[Range], b: Sequence[Range]) -> Range | None:
    """The first units that are in both, or None."""
    for first, last in a:
        for start, end in b:
            if max(first, start) < min(last, end):
                return max(first, start), min(last, end)
    return None


def describe(ranges: Sequence[Range], most: int = 5) -> str:
    """``0:64, 128:192``, the first few of them."""
    named = ", ".join(f"{first}:{last}" for first, last in ranges[:most])
    more = len(ranges) - most
    return named + (f" and {more} more" if more > 0 else "")


def parse(text: str) -> tuple[str, int, int]:
    """``A:B``, the units A ... B-1, or ``K/N``, chunk K of N, counted from 0; ValueError
    otherwise."""
    match = re.fullmatch(r"(\d+)([:/])(\d+)", text)
    if match:
        first, kind, last = int(match[1]), match[2], int(match[3])
        if first < last:
            return kind, first, last
    raise UsageError(
        f"--units {text!r} is neither A:B, the units A to B-1, nor K/N, chunk K of N from 0"
    )


def resolve(text: str, total: int) -> Range:
    """What ``--units`` asks for of a render with so many units; ValueError where there are
    fewer."""
    kind, a, b = parse(text)
    chunk = (a, b) if kind == ":" else (total * a // b, total * (a + 1) // b)
    if chunk[1] > total:
        raise UsageError(f"--units {text}: the render has {total} units, 0:{total}")
    if chunk[0] == chunk[1]:
        raise UsageError(f"--units {text}: the render has only {total} units, and none is left")
    return chunk
