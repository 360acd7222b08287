"""Pictures on a cluster: the loop that hands out their units until all are done."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

from usdmlt.cluster.crew import SECONDS_OF_PATIENCE, Crew, Member
from usdmlt.cluster.picture import TASKS_AHEAD, Picture
from usdmlt.cluster.shipping import Shipment
from usdmlt.errors import Error

if TYPE_CHECKING:
    from distributed import Client, Future

SECONDS_BETWEEN_POLLS = 0.1
OPEN_PICTURES = 2  # the next is begun while workers finish the one before


def pictures(
    client: Client,
    wanted: Iterable[Picture],
    stop: Callable[[], bool] | None = None,
    patience: float = SECONDS_OF_PATIENCE,
) -> Iterator[Picture]:
    """Render pictures, and yield each when it is finished.

    The next of ``wanted`` is asked for when there are workers with nothing to do. After ``stop()``
    nothing more is handed out, and what is handed out is finished. ``patience``: seconds without a
    sign of life after which a worker counts as lost.

    Raises :class:`usdmlt.Error` where the scheduler is lost or no worker can be used; what fails of
    one picture is its :attr:`Picture.failure`.
    """
    loop = _Loop(client, iter(wanted), stop, patience)
    while loop.go_on():
        yield from loop.finished()


class _Loop:
    def __init__(
        self,
        client: Client,
        wanted: Iterator[Picture],
        stop: Callable[[], bool] | None,
        patience: float,
    ) -> None:
        self._client, self._wanted, self._stop = client, wanted, stop
        self._patience = patience
        # No SimpleQueue: when its time is just over it may wait for ever (CPython 3.11).
        self._events: queue.Queue[tuple[Future, Callable[[Future], None]]] = queue.Queue()
        self._shipment = Shipment(client)
        self._open: list[Picture] = []
        self._crew: Crew | None = None
        self._all_begun = False

    def go_on(self) -> bool:
        """One round; whether there is anything left to do."""
        stopped = self._stop is not None and self._stop()
        if stopped:
            self._all_begun = True
            for picture in self._open:
                picture.close()
        if not self._open and not self._begin_next():
            return False
        assert self._crew is not None
        for address in self._look(self._crew):
            for picture in self._open:
                picture.lose(address)
        for member in self._crew.ready:
            while len(member.tasks) < TASKS_AHEAD and self._give(member):
                pass
        self._hear()
        for picture in self._open:
            picture.advance()
        return True

    def finished(self) -> list[Picture]:
        """Those that have just been."""
        done = [picture for picture in self._open if picture.finished]
        self._open = [picture for picture in self._open if not picture.finished]
        return done

    def _look(self, crew: Crew) -> list[str]:
        try:
            return crew.look()
        except Error:
            if self._client.status == "running":
                for picture in self._open:
                    picture.rescue()
            raise

    def _begin_next(self) -> bool:
        picture = None if self._all_begun else next(self._wanted, None)
        if picture is None:
            self._all_begun = True
            return False
        isa = picture.rendering.settings.embree_isa
        self._crew = self._crew or Crew(self._client, isa, self._patience)
        scene = self._shipment.send(picture.rendering.scene)
        picture.begin(self._client, self._crew, scene, self._watch)
        self._open.append(picture)
        return True

    def _give(self, member: Member) -> bool:
        for picture in self._open:
            if picture.pending:
                if not picture.can_give(member):
                    return False
                picture.give(member)
                return True
        if len(self._open) < OPEN_PICTURES and self._begin_next():
            return self._give(member)
        return not member.tasks and any(
            picture.can_give(member) and picture.give_again(member) for picture in self._open
        )

    def _watch(self, future: Future, tell: Callable[[Future], None]) -> None:
        events = self._events
        future.add_done_callback(lambda done: events.put((done, tell)))

    def _hear(self) -> None:
        """What has happened, after a moment's wait if nothing has."""
        with suppress(queue.Empty):
            future, tell = self._events.get(timeout=SECONDS_BETWEEN_POLLS)
            while True:
                tell(future)
                future, tell = self._events.get_nowait()
