"""How much of a stage's geometry has been read, told about ten times a second."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

SECONDS_BETWEEN = 0.1

ReadingProgress = Callable[[int, int], None]  # prims read, of how many


class Tally:
    """Counts prims as they are read; ``tell`` hears of it now and then, and of the last one."""

    def __init__(self, total: int, tell: ReadingProgress | None):
        self.total = total
        self.done = 0
        self._tell = tell
        self._next = perf_counter() + SECONDS_BETWEEN

    def count(self) -> None:
        """One more."""
        self.done += 1
        if self._tell is None or (self.done < self.total and perf_counter() < self._next):
            return
        self._next = perf_counter() + SECONDS_BETWEEN
        self._tell(self.done, self.total)
