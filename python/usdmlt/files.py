"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
import uuid
from collections.abc import Iterator
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
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside ``path`` to write to, which takes its name if all went well.

    If the block raises, nothing changes. OSError becomes :class:`usdmlt.Error`. A symbolic link
    keeps pointing to the file, which is replaced.
    """
    final = Path(os.path.realpath(path))
    temporary = final.with_name(f".{final.stem}.{uuid.uuid4().hex[:8]}{final.suffix}")
    try:
        yield temporary
        os.replace(temporary, final)
    except OSError as error:
        raise Error(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
