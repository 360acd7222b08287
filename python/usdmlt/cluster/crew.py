"""The workers: who is there, who can be used, and who has not been heard of."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any

from usdmlt import fingerprint
from usdmlt._version import __version__
from usdmlt.cluster.ledger import MOST_LOSSES
from usdmlt.errors import Error

if TYPE_CHECKING:
    from distributed import Client, Future

logger = logging.getLogger("usdmlt")

SECONDS_BETWEEN_LOOKS = 1.0
SECONDS_OF_PATIENCE = 30.0  # with a worker that sends no sign of life
# With one that is paused, which ends the task that it has first: of that patience.
PATIENCE_WHEN_PAUSED = 4.0
# What a worker is asked first, in words that one understands which has no usdmlt, or an old one.
_QUESTION = (
    "(lambda u: (u.__version__, "
    "__import__('usdmlt.fingerprint', fromlist=['x']).of_machine({isa!r})"
    " if u.__version__ == {version!r} else None))(__import__('usdmlt'))"
)


@dataclass
class Member:
    """A worker. ``threads``: that it renders with; ``generation``: how many were lost in turn
    before it came; ``answer``: to the first question, pending; ``answered``: whether it was the
    right one; ``ready``: whether it is, and not silent; ``paused``: since when it has been, by
    Dask, as its memory is nearly full; ``tasks``: that it was given."""

    address: str
    threads: int
    heard: float  # by the scheduler's clock
    heard_here: float  # when that last changed
    generation: int
    answer: Future | None = None
    answered: bool = False
    ready: bool = False
    paused: float | None = None
    tasks: list[Any] = field(default_factory=list)  # in order


class Crew:
    """The workers of a client. ``patience``: seconds without a sign of life after which a worker
    counts as lost."""

    def __init__(self, client: Client, isa: str, patience: float = SECONDS_OF_PATIENCE) -> None:
        self.client = client
        self.patience = patience
        self.members: dict[str, Member] = {}
        self._isa = isa
        self._refused: dict[str, str] = {}
        self._generations: dict[str, int] = {}  # of all that ever came
        self._next_generation = 0
        self._lost_at_once: set[int] = set()  # generations, since one was ready
        self._looked = float("-inf")
        self._waiting_said = False

    @property
    def ready(self) -> list[Member]:
        """Those that can be given work."""
        return [member for member in self.members.values() if member.ready]

    def generation(self, address: str) -> int:
        """Of a worker that is here, or was."""
        return self._generations[address]

    def look(self) -> list[str]:
        """See who has come and who is lost; the addresses of the latter.

        :class:`usdmlt.Error` where the scheduler is lost, or where no worker can be used.
        """
        if perf_counter() - self._looked < SECONDS_BETWEEN_LOOKS:
            self._hear_answers()
            return []
        self._looked = now = perf_counter()
        there = self._ask_scheduler()
        gone = [address for address in (*self.members, *self._refused) if address not in there]
        for address, worker in there.items():
            if address in self.members:
                self._hear(self.members[address], worker, now)
            elif address not in self._refused:
                self._welcome(address, worker, now)
        self._hear_answers()
        for address in gone:
            self._forget(address)
        self._complain(there, now)
        return [*gone, *self._drop_useless(now)]

    def refuse(self, address: str, reason: str) -> None:
        """Use a worker no more."""
        self.members.pop(address, None)
        self._refused[address] = reason
        logger.warning("worker %s is not used: %s", address, reason)

    def _hear(self, member: Member, worker: dict[str, Any], now: float) -> None:
        if worker.get("status") != "paused":
            member.paused = None
        elif member.paused is None:
            member.paused = now
        if worker["last_seen"] == member.heard:
            return
        member.heard, member.heard_here = worker["last_seen"], now
        if member.answer is None and not member.ready and not self._is_stuck(member, now):
            self._question(member)  # it was silent or stuck, and is back

    def _is_stuck(self, member: Member, now: float) -> bool:
        since = member.paused
        return since is not None and now - since > PATIENCE_WHEN_PAUSED * self.patience

    def _drop_useless(self, now: float) -> list[str]:
        """The addresses of those that do nothing, though they are there."""
        dropped = []
        for member in self.ready:
            silent = now - member.heard_here > self.patience
            if silent or self._is_stuck(member, now):
                how = "silent" if silent else "paused by Dask, as its memory is nearly full"
                logger.warning("worker %s is %s: its units are rendered again", member.address, how)
                member.ready = False
                member.tasks.clear()
                dropped.append(member.address)
        return dropped

    def _forget(self, address: str) -> None:
        """One that is gone. :class:`usdmlt.Error` where too many were before they could be asked
        anything."""
        member = self.members.pop(address, None)
        self._refused.pop(address, None)
        if member is None:
            return  # it was not used, but may have films
        logger.warning("worker %s is gone: its units are rendered again", address)
        self._next_generation = max(self._next_generation, member.generation + 1)
        if not member.answered:
            self._lost_at_once.add(member.generation)
        if len(self._lost_at_once) >= MOST_LOSSES and not self.ready:
            raise Error(
                f"{MOST_LOSSES} workers in turn were lost at once: is their memory too small?"
            )

    def _ask_scheduler(self) -> dict[str, Any]:
        from distributed.comm import CommClosedError

        try:
            if self.client.status != "running":
                raise CommClosedError
            identity = self.client.sync(self.client.scheduler.identity)
        except (OSError, TimeoutError, AttributeError):
            raise Error("the scheduler of Dask does not answer any more") from None
        workers: dict[str, Any] = identity["workers"]
        return workers

    def _welcome(self, address: str, worker: dict[str, Any], now: float) -> None:
        generation = self._next_generation
        member = Member(address, worker["nthreads"], worker["last_seen"], now, generation)
        self.members[address] = member
        self._generations[address] = generation
        self._question(member)

    def _question(self, member: Member) -> None:
        question = _QUESTION.format(isa=self._isa, version=__version__)
        member.answer = self.client.submit(
            eval, question, pure=False, workers=[member.address], priority=30
        )

    def _hear_answers(self) -> None:
        for member in list(self.members.values()):
            if member.answer is None or not member.answer.done():
                continue
            answer, member.answer = member.answer, None
            if answer.status == "error":
                self.refuse(member.address, f"it has no usdmlt ({answer.exception()})")
            elif answer.status == "finished":
                version, machine = answer.result()
                ours = fingerprint.of_machine(self._isa)
                different = fingerprint.difference(machine or {**ours, "version": version}, ours)
                if different:
                    self.refuse(member.address, different)
                else:
                    member.ready = member.answered = True
                    self._lost_at_once.clear()
            # Else it was lost, which the next look finds.

    def _complain(self, there: dict[str, Any], now: float) -> None:
        usable = [address for address in there if address not in self._refused]
        if there and not usable:
            address, reason = next(iter(self._refused.items()))
            raise Error(f"no worker can be used: of {address}, {reason}")
        if self.members and all(self._is_stuck(member, now) for member in self.members.values()):
            raise Error(
                f"no worker can be used: of {next(iter(self.members))}, Dask has paused it, as its "
                "memory is nearly full"
            )
        if not there and not self._waiting_said:
            logger.info("there are no workers: waiting for some")
        self._waiting_said = not there
