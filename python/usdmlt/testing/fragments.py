"""The report of a test run, of which every process writes its part."""

from __future__ import annotations

import shutil
import uuid
from pathlib import Path

from usdmlt import files

PARTS = ".usdmlt-parts"


def begin(folder: Path) -> None:
    """Make the folder, and forget what a run that was killed has left there; OSError if not."""
    shutil.rmtree(folder / PARTS, ignore_errors=True)
    (folder / PARTS).mkdir(parents=True)


def add(folder: Path, name: str, section: str) -> None:
    """Add a section; sections come in the order of their names."""
    kept = "".join(c if c.isalnum() else "-" for c in name)[:80]
    files.write_text(folder / PARTS / f"{kept}.{uuid.uuid4().hex[:8]}.html", section)


def assemble(folder: Path) -> Path:
    """Write the page and remove its parts; returns its path."""
    from usdmlt.testing.report import page

    parts = sorted((folder / PARTS).glob("*.html"))
    sections = [part.read_text(encoding="utf-8") for part in parts]
    body = sections or ["<p>No check failed.</p>"]
    files.write_text(folder / "index.html", page(body, "usdmlt: checks of pictures"))
    shutil.rmtree(folder / PARTS, ignore_errors=True)
    return folder / "index.html"
