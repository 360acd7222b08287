"""The account of one picture's units: what is to be handed out, who has what, and in which sum it
is. It knows nothing of Dask, but for futures that it keeps.

A unit is at any time in exactly one of: pending, a lease, a sum on a worker, the client's film.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from usdmlt.errors import Error
from usdmlt.units import Range, joined

MOST_LOSSES = 6  # of the same units with their workers, one after the other


@dataclass(eq=False)
class Lease:
    """Units that were handed out. ``attempts``: futures by worker; the first to be done counts."""

    units: Range
    started: float
    losses: int = 0
    attempts: dict[str, Any] = field(default_factory=dict)


@dataclass(eq=False)
class Sum:
    """Units whose sum is on a worker. ``age``: when the films are collected, those of the same
    age are. ``losses``: of its units with workers, since films of them were added. ``of``: while it
    is being made, the sums it is made of; they hold until it is."""

    units: list[Range]
    worker: str
    age: int
    future: Any
    losses: int = 0
    of: tuple[Sum, ...] = ()


class Ledger:
    """Of the units ``ranges``, none of which is done."""

    def __init__(self, ranges: Iterable[Range]) -> None:
        self._pending: list[tuple[Range, int]] = [(range, 0) for range in joined(ranges)]
        self.leases: set[Lease] = set()
        self.sums: set[Sum] = set()

    @property
    def pending(self) -> int:
        """How many units are to be handed out."""
        return sum(last - first for (first, last), _ in self._pending)

    @property
    def is_rendered(self) -> bool:
        """Whether all units are in sums."""
        return not self._pending and not self.leases

    def lease(self, count: int, now: float) -> Lease:
        """The next units, at most so many."""
        (first, last), losses = self._pending.pop(0)
        end = min(last, first + max(count, 1))
        if end < last:
            self._pending.insert(0, ((end, last), losses))
        lease = Lease((first, end), now, losses)
        self.leases.add(lease)
        return lease

    def extend(self, ranges: Iterable[Range]) -> None:
        """Further units, which were not in it."""
        self._pending = sorted([*self._pending, *((range, 0) for range in ranges)])

    def withdraw(self, lease: Lease) -> None:
        """Units that nobody has begun with are handed out no more, or to others."""
        self.leases.discard(lease)
        lease.attempts.clear()
        self._return([lease.units], lease.losses)

    def close(self, collected: int) -> None:
        """Hand out no more than what is needed for the units that are done or begun to have no
        gaps; ``collected``: one beyond the last unit that is in the client's film."""
        ends = [lease.units[1] for lease in self.leases]
        ends += [last for item in self.sums for _, last in item.units]
        end = max([*ends, collected])
        self._pending = [
            ((first, min(last, end)), losses)
            for (first, last), losses in self._pending
            if first < end
        ]

    def settle(self, lease: Lease, worker: str, age: int) -> Sum:
        """An attempt is done: what it gave is a sum, and the others count no more."""
        self.leases.discard(lease)
        result = Sum([lease.units], worker, age, lease.attempts.pop(worker), lease.losses)
        self.sums.add(result)
        return result

    def fail(self, lease: Lease, worker: str) -> None:
        """An attempt came to nothing; :class:`usdmlt.Error` after too many."""
        self._fail(lease, worker)
        self._check_losses()

    def pair(self, a: Sum, b: Sum, future: Any) -> Sum:
        """Two sums are being added, on the worker of the first."""
        self.sums -= {a, b}
        units, losses = joined([*a.units, *b.units]), max(a.losses, b.losses)
        result = Sum(units, a.worker, min(a.age, b.age), future, losses, (a, b))
        self.sums.add(result)
        return result

    def made(self, item: Sum) -> None:
        """Two sums were added."""
        item.of, item.losses = (), 0

    def lose(self, worker: str) -> None:
        """All that is on a worker is lost: it is handed out again. :class:`usdmlt.Error` where the
        same units were too often, while they were rendered or added."""
        for lease in list(self.leases):
            if worker in lease.attempts:
                self._fail(lease, worker)
        for item in list(self.sums):
            self.sums.discard(item)
            self._keep(item, worker)
        self._check_losses()

    def drop(self, item: Sum) -> None:
        """A sum is lost."""
        self.sums.discard(item)
        self._return(item.units, 0)

    def undo(self, item: Sum) -> None:
        """A sum could not be made: what it was to be made of is still there."""
        self.sums.discard(item)
        self.sums |= set(item.of)

    def _fail(self, lease: Lease, worker: str) -> None:
        lease.attempts.pop(worker, None)
        if lease.attempts or lease not in self.leases:
            return
        self.leases.discard(lease)
        self._return([lease.units], lease.losses + 1)

    def _check_losses(self) -> None:
        for (first, last), losses in self._pending:
            if losses >= MOST_LOSSES:
                raise Error(
                    f"units {first}:{last} were lost with {MOST_LOSSES} workers in turn: is their "
                    "memory too small?"
                )

    def _keep(self, item: Sum, lost: str, losses: int = 0) -> None:
        """``losses``: one, where it was being added to another."""
        if item.of:
            if any(part.worker == lost for part in item.of):
                for part in item.of:
                    self._keep(part, lost, losses=1)
            else:
                self.sums.add(item)
        elif item.worker == lost:
            self._return(item.units, item.losses + losses)
        else:
            self.sums.add(item)

    def _return(self, ranges: Iterable[Range], losses: int) -> None:
        self._pending = sorted([*self._pending, *((range, losses) for range in ranges)])
