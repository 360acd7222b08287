"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from usdmlt.errors import Error


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise :class:`usdmlt.Error` now if a file of that name could not be written later."""
    target = Path(path)
    if target.is_dir():
        raise Error(f"cannot write {target}: it is a directory")
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise Error(f"cannot write {target}: {error.strerror}") from error


@contextmanager
def replacing(
    path: str | os.PathLike[str],
    durable: bool = False,
    before: Callable[[Path], None] | None = None,
) -> Iterator[Path]:
    """A temporary path beside ``path`` to write to, which takes its name if all went well.

    If the block raises, nothing changes. OSError becomes :class:`usdmlt.Error`. A symbolic link
    keeps pointing to the file, which is replaced. ``durable``: it outlasts a loss of power once
    this returns; and what a killed process left of it is written over. ``before`` is called with
    the file's path when all is written, just before it is replaced.
    """
    final = Path(os.path.realpath(path))
    name = "partial" if durable else uuid.uuid4().hex[:8]
    temporary = final.with_name(f".{final.stem}.{name}{final.suffix}")
    try:
        yield temporary
        if durable:
            _sync(temporary)
        if before is not None:
            before(final)
        os.replace(temporary, final)
        if durable and os.name == "posix":
            _sync(final.parent)
    except OSError as error:
        reason = error.strerror or _refusal(temporary) or error
        raise Error(f"cannot write {path}: {reason}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _refusal(path: Path) -> str | None:
    """Why the system lets a file not grow, which OpenImageIO does not tell; None where it does."""
    try:
        with open(path, "ab") as file:
            file.write(bytes(2**20))
    except OSError as error:
        return error.strerror
    return None


def _sync(path: Path) -> None:
    """Onto the disk; of a folder, the names in it."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
