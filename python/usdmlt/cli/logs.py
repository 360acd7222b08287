"""What the command line prints: the logger `usdmlt`, one line each on stderr."""

from __future__ import annotations

import argparse
import logging
import sys
from typing import TextIO

logger = logging.getLogger("usdmlt")


class _Handler(logging.StreamHandler):  # type: ignore[type-arg]  # it takes none in Python 3.10
    """Writes to what sys.stderr is at the time: a progress bar puts itself in between."""

    def __init__(self) -> None:
        logging.Handler.__init__(self)

    @property
    def stream(self) -> TextIO:  # type: ignore[override]
        return sys.stderr


class _Formatter(logging.Formatter):
    """`usdmlt: warning: …` for warnings and errors, the bare message for the rest."""

    def format(self, record: logging.LogRecord) -> str:
        message = " ".join(record.getMessage().split())
        if record.levelno < logging.WARNING:
            return message
        return f"usdmlt: {record.levelname.lower()}: {message}"


def configure_logging(verbosity: int) -> None:
    """``verbosity``: -1 errors only, 0 messages and warnings, 1 everything."""
    handler = _Handler()
    handler.setFormatter(_Formatter())
    logger.handlers = [handler]
    logger.propagate = False
    logger.setLevel({-1: logging.ERROR, 0: logging.INFO}.get(verbosity, logging.DEBUG))


def add_verbosity(container: argparse._ActionsContainer) -> None:
    """Declare -v and -q."""
    group = container.add_mutually_exclusive_group()
    group.add_argument(
        "-v",
        "--verbose",
        dest="verbosity",
        action="store_const",
        const=1,
        default=0,
        help="print more; errors come with their traceback",
    )
    group.add_argument(
        "-q", "--quiet", dest="verbosity", action="store_const", const=-1, help="print errors only"
    )
