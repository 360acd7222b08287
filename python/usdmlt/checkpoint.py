"""Checkpoints: the work so far in a file, from which a render goes on as if it had never stopped.

A checkpoint is a part file (:mod:`usdmlt.parts`). The one before it is kept as NAME.previous.EXT.
"""

from __future__ import annotations

import logging
import math
import os
import shutil
import signal
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import TYPE_CHECKING

from usdmlt import files, fingerprint, parts
from usdmlt.errors import Error, UsageError
from usdmlt.interruption import Interruption

if TYPE_CHECKING:
    from usdmlt.rendering import Rendering
    from usdmlt.settings import Settings

logger = logging.getLogger("usdmlt")

SECONDS = 60.0  # between checkpoints, unless told otherwise
# Of the time: with large films, checkpoints are fewer.
LARGEST_SHARE = 1 / 150


class Checkpoint:
    """A file that has the work of a render so far.

    ``path``: its name, best with ``.exr``. ``seconds``: between checkpoints; None: a minute, or
    more where writing takes so long that it would be more than a hundredth of the time. Entered, it
    writes one at SIGUSR1 as well.

    Raises :class:`usdmlt.Error` where the file cannot be written, and ValueError for a time that is
    none.
    """

    def __init__(self, path: str | os.PathLike[str], seconds: float | None = None) -> None:
        if seconds is not None and not (seconds > 0 and math.isfinite(seconds)):
            raise UsageError(f"the seconds between checkpoints must be positive, not {seconds}")
        self.path = Path(path)
        self.seconds = seconds
        self._cost = 0.0
        self._units = 0
        self._failure = ""
        self._due: float | None = None
        self._asked = Interruption(*_ASKING, always=True)
        files.check_writable(path)

    @property
    def previous(self) -> Path:
        """The checkpoint before the last."""
        return self.path.with_name(f"{self.path.stem}.previous{self.path.suffix}")

    def __enter__(self) -> Checkpoint:
        self._asked.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._asked.__exit__(kind, error, traceback)

    def read(self) -> parts.RenderPart | None:
        """What the file has; None where there is none yet. :class:`usdmlt.Error` where it is
        damaged, or something else."""
        if not self.path.exists():
            if self.previous.exists():
                raise Error(f"{self.path} is not there, but {self.previous} is: give it that name")
            logger.info("%s is not there yet: nothing to resume", self.path)
            return None
        try:
            return parts.read(self.path)
        except Error as error:
            hint = f"; {self.previous} is the one before it" if self.previous.exists() else ""
            raise Error(f"{error}{hint}") from None

    def check_is_new(self) -> None:
        """Raise :class:`usdmlt.Error` where there is one already, whose work would be lost."""
        if self.path.exists():
            raise Error(f"{self.path} is there already: resume it, or remove it to start anew")

    def restore(self, rendering: Rendering, part: parts.RenderPart) -> None:
        """Give the rendering what the file had; :class:`usdmlt.Error` where it is of another."""
        difference = fingerprint.difference(part.fingerprint, rendering.fingerprint)
        if difference:
            raise Error(f"{self.path} is the checkpoint of another render: {difference}")
        rendering.add(part.state)
        self._units = rendering.units_done

    def wait(self, now: float) -> float:
        """Seconds from ``now`` until it is due."""
        if self._due is None:
            self._due = now + (self.seconds or SECONDS)
        return 0.0 if self._asked else self._due - now

    def update(self, rendering: Rendering) -> None:
        """Write it while the render goes on, which it does where that fails: with a warning, once
        for each reason."""
        try:
            self.write(rendering)
            self._failure = ""
        except Error as error:
            if str(error) != self._failure:
                logger.warning("%s; the render goes on, and tries again", error)
            self._failure = str(error)
        self._asked.signal = None
        pause = self.seconds or max(SECONDS, self._cost / LARGEST_SHARE)
        self._due = perf_counter() + pause

    def write(self, rendering: Rendering) -> None:
        """Write it, unless the file has all of the work; :class:`usdmlt.Error` where that fails,
        and the file is then as it was. A rendering that has lost its work leaves it so too."""
        if rendering.units_done <= self._units:
            return
        started = perf_counter()
        try:
            parts.write(self.path, rendering.part(), compression="none", before=self._keep)
        except MemoryError:
            raise Error(f"cannot write {self.path}: out of memory") from None
        self._units = rendering.units_done
        self._cost = perf_counter() - started
        logger.debug("wrote %s in %.2f s", self.path, self._cost)

    def _keep(self, path: Path) -> None:
        """There is a whole file of this name at all times, also while it becomes the previous."""
        if path.exists():
            previous = path.with_name(self.previous.name)
            second_name = path.with_name(f".{previous.name}")
            second_name.unlink(missing_ok=True)
            try:
                try:
                    os.link(path, second_name)
                except OSError:  # there are file systems without links
                    shutil.copyfile(path, second_name)
                os.replace(second_name, previous)
            finally:
                second_name.unlink(missing_ok=True)


def open_checkpoint(
    path: str | os.PathLike[str] | None, resume: bool, seconds: float | None = None
) -> tuple[Checkpoint | None, parts.RenderPart | None]:
    """The checkpoint at a path, if there is to be one, and what it has, if it is to be resumed.

    Raises :class:`usdmlt.Error` where it is there already and is not to be resumed: its work would
    be lost.
    """
    if path is None:
        if resume:
            raise UsageError("to resume, name the checkpoint")
        return None, None
    checkpoint = Checkpoint(path, seconds)
    if resume:
        return checkpoint, checkpoint.read()
    checkpoint.check_is_new()
    return checkpoint, None


def settings_to_resume(settings: Settings, part: parts.RenderPart) -> Settings:
    """The settings, with the integrator that an automatic choice led to when it began."""
    automatic = settings.integrator == "auto" and settings.mutations is None
    if automatic and settings.mutation_weights is None:
        return replace(settings, integrator=part.fingerprint["settings"]["integrator"])
    return settings


_ASKING = (signal.SIGUSR1,) if hasattr(signal, "SIGUSR1") else ()
