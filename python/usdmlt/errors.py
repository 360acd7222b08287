"""Errors and warnings: one line each, naming the prim or the file."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field

log = logging.getLogger("usdmlt")

PATHS_NAMED = 3  # prim paths a warning names before it only counts


class Error(Exception):
    """What was asked for cannot be done. The message is one line and names the prim or the file."""

    def __init__(self, message: str):
        # Values that are quoted, matrices and strings, may have several.
        super().__init__(" ".join(line.strip() for line in message.splitlines()))


class UsageError(ValueError):
    """A value that makes no sense, such as an image of 0 pixels."""


def named(names: Sequence[str]) -> str:
    """The first few of them, and how many more there are."""
    more = len(names) - PATHS_NAMED
    return ", ".join(names[:PATHS_NAMED]) + (f" and {more} more" if more > 0 else "")


@dataclass
class Warning:
    """Content of one kind that is not rendered as authored, and the prims that have it."""

    kind: str
    paths: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        if not self.paths:
            return self.kind
        return f"{self.kind}: {named(self.paths)}"


class Report:
    """Collects warnings, one per kind, and logs them with the prims that share it.

    With ``strict`` the first :meth:`warn` raises :class:`Error` instead.
    """

    def __init__(self, strict: bool = False):
        self.strict = strict
        self._warnings: dict[str, Warning] = {}
        self._seen: set[tuple[str, str]] = set()

    def warn(self, kind: str, path: object = "") -> None:
        """Note that ``path`` has content of an unsupported (or damaged) ``kind``."""
        path = str(path)
        if self.strict:
            raise Error(f"{path}: {kind}" if path else kind)
        self.note(kind, path)

    def note(self, kind: str, path: object = "") -> None:
        """As :meth:`warn`, for choices that are no fault of the content: never an error."""
        path = str(path)
        if (kind, path) in self._seen:
            return
        self._seen.add((kind, path))
        warning = self._warnings.setdefault(kind, Warning(kind))
        if path:
            warning.paths.append(path)

    @property
    def warnings(self) -> list[Warning]:
        """The warnings so far, in the order in which their kinds came up."""
        return list(self._warnings.values())

    def log(self) -> None:
        """Send the warnings to the ``usdmlt`` logger."""
        for warning in self.warnings:
            log.warning("%s", warning)
