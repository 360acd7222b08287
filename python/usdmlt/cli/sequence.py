"""All pictures of `usdmlt render`: one after the other here, or together on a cluster."""

from __future__ import annotations

import argparse
import logging
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from usdmlt.cli.asked import Asked
from usdmlt.cli.pictures import Pictures
from usdmlt.cli.work import Job, Work
from usdmlt.errors import Error, UsageError, named

if TYPE_CHECKING:
    from distributed import Client

    from usdmlt.cluster.picture import Picture
    from usdmlt.rendering import Progress

logger = logging.getLogger("usdmlt")


def render_all(
    arguments: argparse.Namespace, asked: Asked, jobs: Sequence[Job], pictures: Pictures
) -> int:
    """Render and write all pictures; 0, or 128 + the number of the signal that stopped it.

    One that fails does not take the others along: :class:`usdmlt.Error` comes at the end.
    """
    sequence = _Sequence(arguments, asked, jobs, pictures)
    if arguments.cluster is not None or arguments.workers is not None:
        return sequence.on_cluster()
    return sequence.here()


class _Sequence:
    def __init__(
        self, arguments: argparse.Namespace, asked: Asked, jobs: Sequence[Job], pictures: Pictures
    ) -> None:
        self._arguments, self._asked, self._pictures = arguments, asked, pictures
        self._jobs = jobs
        self._quiet = arguments.verbosity < 0
        self._failed: list[str] = []
        self._written = 0

    def here(self) -> int:
        from usdmlt.cli.progress import display
        from usdmlt.interruption import Interruption

        for job in self._jobs:
            try:
                work = self._open(job)
                with Interruption(signal.SIGINT, signal.SIGTERM, always=True) as interruption:
                    settings = work.rendering.settings
                    with display(settings, self._arguments.progress, self._quiet) as progress:
                        work.run(lambda: bool(interruption), progress)
                    work.finish()
            except (Error, UsageError, MemoryError) as error:
                self._fail(job, error)
                continue
            self._written += 1
            if interruption.signal is not None:
                return self._stopped(interruption.signal)
        return self._outcome()

    def on_cluster(self) -> int:
        from usdmlt.cluster.rendering import pictures
        from usdmlt.interruption import Interruption

        open_now: list[Work] = []
        with (
            _client(self._arguments) as client,
            Interruption(signal.SIGINT, signal.SIGTERM, always=True) as interruption,
        ):
            begun = self._begun(open_now)
            try:
                for picture in pictures(client, begun, lambda: bool(interruption)):
                    work: Work = picture.context
                    open_now.remove(work)
                    self._finish(work, picture.failure)
            except Error:
                # The cluster is lost: what there is of the pictures is kept.
                for work in open_now:
                    self._finish(work, None)
                raise
        if interruption.signal is not None:
            return self._stopped(interruption.signal)
        return self._outcome()

    def _open(self, job: Job) -> Work:
        return Work(self._arguments, self._asked, job, self._pictures)

    def _begun(self, open_now: list[Work]) -> Iterator[Picture]:
        """The pictures, each when there are workers for it."""
        from usdmlt.cli.progress import display
        from usdmlt.cluster.picture import Picture

        for job in self._jobs:
            try:
                work = self._open(job)
            except (Error, UsageError, MemoryError) as error:
                self._fail(job, error)
                continue
            open_now.append(work)
            settings = work.rendering.settings
            with display(settings, self._arguments.progress, self._quiet) as progress:
                yield Picture(
                    work.rendering,
                    *work.range,
                    _of_first(open_now, work, progress),
                    work.checkpoint,
                    work.previews,
                    context=work,
                )

    def _finish(self, work: Work, failure: Error | None) -> None:
        try:
            work.finish()
            if failure is not None:
                raise failure
        except (Error, MemoryError) as error:
            self._fail(work.job, error)
        else:
            self._written += 1

    def _fail(self, job: Job, error: Exception) -> None:
        """A single picture's error is that of the command."""
        if len(self._jobs) == 1:
            raise error
        logger.error("%s failed: %s", job.output, str(error) or "out of memory")
        self._failed.append(job.output)

    def _stopped(self, number: signal.Signals) -> int:
        if len(self._jobs) > 1:
            logger.warning(
                "stopped: %d of %d pictures were begun", self._begun_count, len(self._jobs)
            )
        return 128 + number

    @property
    def _begun_count(self) -> int:
        return self._written + len(self._failed)

    def _outcome(self) -> int:
        if self._failed:
            raise Error(
                f"{self._written} of {len(self._jobs)} pictures were written, not "
                f"{named(self._failed)}"
            )
        return 0


def _of_first(
    open_now: list[Work], work: Work, progress: Callable[[Progress], None] | None
) -> Callable[[Progress], None] | None:
    """The progress of the first picture of those that are rendered together."""
    if progress is None:
        return None

    def tell(made: Progress) -> None:
        if open_now[:1] == [work]:
            progress(made)

    return tell


def _client(arguments: argparse.Namespace) -> AbstractContextManager[Client]:
    from usdmlt.cluster import connection

    if arguments.cluster is not None:
        return connection.connected(arguments.cluster)
    return connection.local(arguments.workers, arguments.threads)
