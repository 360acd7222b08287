"""One picture on a cluster: units handed out, sums made on the workers, and collected here."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol

from usdmlt import target_error
from usdmlt.checkpoint import Checkpoint
from usdmlt.cluster import worker
from usdmlt.cluster.ledger import MOST_LOSSES, Lease, Ledger, Sum
from usdmlt.errors import Error
from usdmlt.units import count, gaps

if TYPE_CHECKING:
    from distributed import Client, Future

    from usdmlt.cluster.crew import Crew, Member
    from usdmlt.previews import Preview
    from usdmlt.rendering import Progress, Rendering

logger = logging.getLogger("usdmlt")

# Of a lease: so long that clearing, copying and adding its film is a small part of it.
SECONDS_PER_BYTE = 1.6e-7
LEAST_SECONDS, MOST_SECONDS = 1.0, 120.0
SMALLEST_LEASE = 1 / 6  # of that, towards the end
# Of the first of a worker, whose speed is not known: samples or mutations by thread, and how many
# such there should be by worker at least.
FIRST_SAMPLES, FIRST_LEASES = 2.0**19, 64
TASKS_AHEAD = 2  # per worker: one to render, one to go on with
# Of the time that is expected, before another worker tries the same.
SLOW, SLOW_SECONDS = 3.0, 2.0
COLLECTING_SHARE = 0.05  # of the time, at most, for what is looked at in between
COLLECTED_EVERY = 600.0  # seconds, at least: what is here is not lost with workers
GATHER_SECONDS, GATHER_BYTES_PER_SECOND = 30.0, 1e7


class Watch(Protocol):
    """Calls ``tell(future)`` from the main loop when the future is done."""

    def __call__(self, future: Future, tell: Callable[[Future], None]) -> None: ...


class Picture:
    """A rendering whose units ``first`` to ``last`` - 1 a cluster renders; what of them it has is
    not rendered again.

    When ``finished``, it has them all, or what there was when it was closed or failed: ``failure``
    says why.
    """

    def __init__(
        self,
        rendering: Rendering,
        first: int = 0,
        last: int | None = None,
        progress: Callable[[Progress], None] | None = None,
        checkpoint: Checkpoint | None = None,
        previews: Sequence[Preview] = (),
        context: Any = None,
    ) -> None:
        self.rendering = rendering
        self.range = first, rendering.units_total if last is None else last
        self.context = context  # of the caller
        self.finished = False
        self.failure: Error | None = None
        self._progress, self._checkpoint, self._previews = progress, checkpoint, previews
        self._units_before = rendering.units_done
        self._ledger = Ledger([])
        self._age = 0
        self._prepared: dict[str, Any] = {}  # by worker: the future of its plan
        self._able: set[str] = set()  # workers that have made it
        self._lost_preparing: set[int] = set()  # generations of workers, since one was able
        self._full: set[str] = set()  # workers that have no memory to add films
        self._rates: dict[str, float] = {}  # units per second by worker
        self._last_done: dict[str, float] = {}
        self._started: float | None = None
        self._collected = perf_counter()
        self._collecting_took = 0.0
        self._closed = False
        sums = rendering.state().sums
        self._bytes = sum(plane.nbytes for plane in sums.values())

    def begin(self, client: Client, crew: Crew, scene: list[Future], watch: Watch) -> None:
        """Ready to be handed out."""
        self._client, self._crew, self._watch, self._scene = client, crew, watch, scene
        settings = replace(
            self.rendering.settings,
            integrator=self.rendering.integrator,
            time=None,
            samples=None
            if self.rendering.settings.mutations is not None
            else self.rendering.settings.resolved_samples,
        )
        key = f"{self.rendering.fingerprint}"
        self._plan = worker.Plan(key, settings, self.rendering.fingerprint)
        self._next_units()

    @property
    def pending(self) -> int:
        """How many units are to be handed out."""
        return self._ledger.pending

    def close(self) -> None:
        """Hand out no more; what has begun is finished."""
        if self._closed:
            return
        self._closed = True
        for member in self._crew.members.values():
            for lease in member.tasks[1:]:
                attempt = lease.attempts.get(member.address)
                if lease in self._ledger.leases and len(lease.attempts) == 1:
                    self._ledger.withdraw(lease)
                    self._cancel([attempt])
            member.tasks = [lease for lease in member.tasks if lease.attempts]
        units = self.rendering.units
        self._ledger.close(units[-1][1] if units else 0)

    def can_give(self, member: Member) -> bool:
        """Whether a worker has the plan; if not, it is told to make it."""
        from usdmlt.cluster.worker import prepare

        address = member.address
        if address not in self._prepared:
            self._prepared[address] = self._client.submit(
                prepare, self._plan, *self._scene, pure=False, workers=[address], priority=20
            )
            self._watch(self._prepared[address], lambda future: self._prepare_done(address, future))
        return bool(self._prepared[address].status == "finished")

    def _prepare_done(self, address: str, future: Any) -> None:
        told = address in self._prepared and self._prepared[address] is future
        if told and future.status == "finished":
            self._able.add(address)
            self._lost_preparing.clear()
        elif told:
            del self._prepared[address]
            if future.status == "error":
                self._judge(address, future.exception())

    def give(self, member: Member) -> None:
        """Hand out the next units to a worker."""
        now = perf_counter()
        self._started = self._started or now
        self._send(self._ledger.lease(self._size(member), now), member)

    def give_again(self, member: Member) -> bool:
        """Hand out to an idle worker what another is slow with; whether there was any."""
        now = perf_counter()
        for lease in sorted(self._ledger.leases, key=lambda lease: lease.started):
            if len(lease.attempts) != 1 or member.address in lease.attempts:
                continue
            holder = self._crew.members.get(next(iter(lease.attempts)))
            waits = holder is not None and holder.tasks[:1] != [lease]
            rate = self._rate(member.address)
            expected = (lease.units[1] - lease.units[0]) / rate if rate else 60.0
            if waits or now - lease.started > SLOW * expected + SLOW_SECONDS:
                self._send(lease, member)
                return True
        return False

    def lose(self, address: str) -> None:
        """A worker is lost, with all that is on it."""
        lost = [
            lease.attempts[address] for lease in self._ledger.leases if address in lease.attempts
        ]
        lost += [item.future for item in self._ledger.sums if item.worker == address]
        if address in self._prepared:
            lost.append(self._prepared.pop(address))
            if address not in self._able:
                self._lost_preparing.add(self._crew.generation(address))
        self._able.discard(address)
        self._cancel(lost)
        self._guarded(lambda: self._ledger.lose(address))
        if len(self._lost_preparing) >= MOST_LOSSES and not self._able:
            self.failure = Error(
                f"{MOST_LOSSES} workers in turn were lost with the scene: is their memory too "
                "small?"
            )

    def advance(self) -> None:
        """Add and collect what can be, and see whether all is done."""
        if self.finished:
            return
        if self.failure:
            self.rescue()
            self.finished = True
            return
        limit = self.rendering.settings.time
        if limit is not None and self._started and perf_counter() - self._started >= limit:
            self.close()
        if not self._collecting and self._is_due():
            self._age += 1
        self._add_up()
        self._collect()
        if self._ledger.is_rendered and not self._ledger.sums and not self.failure:
            self._next_units()
            self.finished = self._ledger.is_rendered
        self._tell()

    # -- units ------------------------------------------------------------------------------------

    def _next_units(self) -> None:
        """All that is left, or up to where the error is looked at."""
        if self._closed or self.rendering.is_good_enough():
            return
        missing = gaps(self.range, self.rendering.units)
        if missing:
            first, last = missing[0]
            end = target_error.next_look(self.rendering, first, last)
            self._ledger.extend(missing if end == last else [(first, end)])

    def _send(self, lease: Lease, member: Member) -> None:
        from usdmlt.cluster.worker import render_units

        address = member.address
        future = self._client.submit(
            render_units,
            self._plan,
            *lease.units,
            pure=False,
            workers=[address],
        )
        lease.attempts[address] = future
        member.tasks.append(lease)
        self._watch(future, lambda future: self._lease_done(lease, address, future))

    def _lease_done(self, lease: Lease, address: str, future: Any) -> None:
        member = self._crew.members.get(address)
        if member is not None and lease in member.tasks:
            member.tasks.remove(lease)
        attempt = lease.attempts.get(address)
        if lease not in self._ledger.leases or attempt is None or attempt is not future:
            return  # it was declared lost, or another was faster
        if future.status == "finished":
            now = perf_counter()
            began = max(lease.started, self._last_done.get(address, 0.0))
            self._last_done[address] = now
            units = lease.units[1] - lease.units[0]
            self._rates[address] = units / max(now - began, 1e-3)
            self._ledger.settle(lease, address, self._age)
            for other in lease.attempts:
                slower = self._crew.members.get(other)
                if slower is not None and lease in slower.tasks:
                    slower.tasks.remove(lease)
            self._cancel(lease.attempts.values())
            return
        self._guarded(lambda: self._ledger.fail(lease, address))
        if future.status == "error":
            self._judge(address, future.exception())

    def _judge(self, address: str, error: BaseException | None) -> None:
        """A worker could not render units: because of the scene, the worker, or its memory."""
        from usdmlt.cluster.worker import Unprepared

        if isinstance(error, Error):
            self.failure = error
        elif isinstance(error, Unprepared):
            self._prepared.pop(address, None)
        elif isinstance(error, MemoryError):
            self._crew.refuse(address, "it is out of memory")  # its sums are still there
        else:
            self._crew.refuse(address, str(error) or type(error).__name__)
            self.lose(address)

    def _size(self, member: Member) -> int:
        """Units for a worker: as many as it renders in the time of a lease, and fewer towards the
        end, so that all end at the same time."""
        workers = max(len(self._crew.ready), 1)
        rate = self._rate(member.address)
        if rate is None:
            samples = FIRST_SAMPLES * member.threads / max(self.rendering.samples_per_unit, 1.0)
            most = count([self.range]) / (FIRST_LEASES * workers)
            return max(int(min(samples, most)), 1)
        seconds = min(max(self._bytes * SECONDS_PER_BYTE, LEAST_SECONDS), MOST_SECONDS)
        limit = self.rendering.settings.time
        if limit is not None and self._started is not None:
            seconds = min(seconds, max(self._started + limit - perf_counter(), 0.0))
        share = max(self._ledger.pending / (2 * workers), rate * seconds * SMALLEST_LEASE)
        return max(round(min(rate * seconds, share)), 1)

    def _rate(self, address: str) -> float | None:
        if address in self._rates:
            return self._rates[address]
        return median(self._rates.values()) if self._rates else None

    # -- sums -------------------------------------------------------------------------------------

    @property
    def _collecting(self) -> bool:
        return any(item.age < self._age for item in self._ledger.sums)

    def _is_due(self) -> bool:
        """Whether what there is should be collected now."""
        if not self._ledger.sums:
            return False
        if self._ledger.is_rendered:
            return True
        now = perf_counter()
        if now - self._collected < self._collecting_took / COLLECTING_SHARE:
            return False
        is_due = now - self._collected >= COLLECTED_EVERY
        is_due |= self._checkpoint is not None and self._checkpoint.wait(now) <= 0
        return is_due or any(preview.wait(now) <= 0 for preview in self._previews)

    def _add_up(self) -> None:
        """Pairs of sums on one worker are added there; when collecting, those of two workers
        too, once each has one."""
        sums = [item for item in self._ledger.sums if item.worker not in self._full]
        holders = [item.worker for item in sums if item.age < self._age and not item.of]
        one_each = len(set(holders)) == len(holders)
        there: dict[Any, Sum] = {}
        for item in sorted(sums, key=lambda item: item.units):
            if item.of:
                continue
            old = item.age < self._age
            place = "all" if old and one_each else (item.worker, old)
            other = there.pop(place, None)
            if other is None:
                there[place] = item
            else:
                self._add(other, item)

    def _add(self, a: Sum, b: Sum) -> None:
        from usdmlt.cluster.worker import add

        future = self._client.submit(
            add, a.future, b.future, pure=False, workers=[a.worker], priority=10
        )
        item = self._ledger.pair(a, b, future)
        self._watch(future, lambda future: self._sum_done(item, future))

    def _sum_done(self, item: Sum, future: Any) -> None:
        if item not in self._ledger.sums or item.future is not future:
            return
        if future.status == "finished":
            self._ledger.made(item)
            return
        self._ledger.undo(item)
        if future.status != "error":
            return
        error = future.exception()
        if isinstance(error, MemoryError):
            self._full.add(item.worker)
            self._crew.refuse(item.worker, "it is out of memory")
        else:
            self.failure = Error(f"worker {item.worker} could not add films: {error!r}")

    def _collect(self) -> None:
        """The last sum of those that are collected comes here, and those that no worker adds."""
        old = [item for item in self._ledger.sums if item.age < self._age]
        ready = [item for item in old if item.worker in self._full or len(old) == 1]
        if not ready or ready[0].of:
            return
        started = perf_counter()
        if self._take(ready[0]):
            self._show()
        self._collected = perf_counter()
        self._collecting_took = self._collected - started

    def _take(self, item: Sum) -> bool:
        """Into the film here; False where it is lost."""
        patience = GATHER_SECONDS + self._bytes / GATHER_BYTES_PER_SECOND
        try:
            state = item.future.result(timeout=patience)
        except MemoryError:
            self.failure = Error("there is not enough memory here for the films of workers")
            return False
        except Exception as error:
            logger.warning(
                "a sum of worker %s is lost (%r): it is rendered again", item.worker, error
            )
            self._cancel([item.future])
            self._ledger.drop(item)
            return False
        self.rendering.add(state)
        self._ledger.sums.discard(item)
        return True

    def _show(self) -> None:
        now = perf_counter()
        if self._checkpoint is not None and self._checkpoint.wait(now) <= 0:
            self._checkpoint.update(self.rendering)
        self.rendering.show(self._previews)

    def rescue(self) -> None:
        """Keep what is whole on workers, after a failure."""
        for item in list(self._ledger.sums):
            for part in item.of or (item,):
                if part.future.done() and part.future.status == "finished":
                    self._take(part)
        self._cancel(future for lease in self._ledger.leases for future in lease.attempts.values())
        self._cancel(self._prepared.values())

    def _tell(self) -> None:
        if self._progress is None:
            return
        seconds = 0.0 if self._started is None else perf_counter() - self._started
        done = self.rendering.units_done + sum(count(item.units) for item in self._ledger.sums)
        total = count([self.range])
        self._progress(self.rendering.progress(done, total, seconds, self._units_before))

    def _guarded(self, change: Callable[[], None]) -> None:
        try:
            change()
        except Error as error:
            self.failure = error

    def _cancel(self, futures: Any) -> None:
        futures = list(futures)
        if futures:
            self._client.cancel(futures)
