"""`--traceToFile`: what USD itself did, as usdrecord reports it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

from usdmlt import files

FORMATS = ("chrome", "trace")
ENDS = {"chrome": b"]}", "trace": b"\n\n"}


def add_tracing_flags(container: argparse._ActionsContainer) -> None:
    """Declare the flags."""
    container.add_argument(
        "--traceToFile", metavar="FILE", help="write there what USD did, and how long it took"
    )
    container.add_argument(
        "--traceFormat",
        choices=FORMATS,
        default="chrome",
        help="of that file: for chrome://tracing, or text (default: %(default)s)",
    )


@contextmanager
def tracing(path: str | None, form: str) -> Iterator[None]:
    """Trace USD's own functions within the block into a file; None: do not."""
    if path is None:
        yield
        return
    from pxr import Trace

    files.check_writable(path)
    collector, reporter = Trace.Collector(), Trace.Reporter.globalReporter
    collector.enabled = True
    try:
        yield
    finally:
        collector.enabled = False
        with files.replacing(path) as temporary:
            write = reporter.ReportChromeTracingToFile if form == "chrome" else reporter.Report
            write(str(temporary))
            # USD does not tell whether it could.
            if not temporary.is_file() or not temporary.read_bytes().endswith(ENDS[form]):
                raise OSError("the end of the file could not be written")
