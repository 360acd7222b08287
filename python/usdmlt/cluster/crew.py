"""The workers: who is there, who can be used, and who has not been heard of."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any

from usdmlt import fingerprint
from usdmlt._version import __version__
from usdmlt.errors import Error

if TYPE_CHECKING:
    from distributed import Client, Future

logger = logging.getLogger("usdmlt")

SECONDS_BETWEEN_LOOKS = 1.0
SECONDS_OF_PATIENCE = 30.0  # with a worker that sends no sign of life
# What a worker is asked first, in words that one understands which has no usdmlt, or an old one.
_QUESTION = (
    "(lambda u: (u.__version__, "
    "__import__('usdmlt.fingerprint', fromlist=['x']).of_machine({isa!r})"
    " if u.__version__ == {version!r} else None))(__import__('usdmlt'))"
)


@dataclass
class Member:
    """A worker. ``threads``: that it renders with; ``answer``: to the first question, pending;
    ``ready``: whether it was the right one; ``tasks``: that it was given."""

    address: str
    threads: int
    heard: float  # by the scheduler's clock
    heard_here: float  # when that last changed
    answer: Future | None = None
    ready: bool = False
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
        self._looked = float("-inf")
        self._waiting_said = False

    @property
    def ready(self) -> list[Member]:
        """Those that can be given work."""
        return [member for member in self.members.values() if member.ready]

    def look(self) -> list[str]:
        """See who has come and who is lost; the addresses of the latter.

        :class:`usdmlt.Error` where the scheduler is lost, or where all workers are wrong ones.
        """
        if perf_counter() - self._looked < SECONDS_BETWEEN_LOOKS:
            self._hear_answers()
            return []
        self._looked = now = perf_counter()
        there = self._ask_scheduler()
        lost = [address for address in self.members if address not in there]
        for address, worker in there.items():
            member = self.members.get(address)
            if member is None:
                if address not in self._refused:
                    self._welcome(address, worker, now)
            elif worker["last_seen"] != member.heard:
                member.heard, member.heard_here = worker["last_seen"], now
                if member.answer is None and not member.ready:
                    self._question(member)  # it was silent, and is back
            elif member.ready and now - member.heard_here > self.patience:
                logger.warning("worker %s is silent: its units are rendered again", address)
                member.ready = False
                member.tasks.clear()
                lost.append(address)
        for address in lost:
            if address not in there:
                logger.warning("worker %s is gone: its units are rendered again", address)
                del self.members[address]
        self._hear_answers()
        self._complain(there)
        return lost

    def refuse(self, address: str, reason: str) -> None:
        """Use a worker no more."""
        self.members.pop(address, None)
        self._refused[address] = reason
        logger.warning("worker %s is not used: %s", address, reason)

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
        member = Member(address, worker["nthreads"], worker["last_seen"], now)
        self.members[address] = member
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
                    member.ready = True
            # Else it was lost, which the next look finds.

    def _complain(self, there: dict[str, Any]) -> None:
        usable = [address for address in there if address not in self._refused]
        if there and not usable:
            address, reason = next(iter(self._refused.items()))
            raise Error(f"no worker can be used: of {address}, {reason}")
        if not there and not self._waiting_said:
            logger.info("there are no workers: waiting for some")
        self._waiting_said = not there
