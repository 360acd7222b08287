"""The command line: one module per subcommand.

A subcommand module has ``add_parser(subparsers)``, which declares its flags and sets ``run``, and
``run(arguments) -> int``, which returns the exit status. Parsing imports nothing heavy.

Exit status: 0 done; 1 it could not be done (one line on stderr), or `compare` found a difference;
2 wrong flags or values, or pictures that `compare` cannot read or that differ in size; 130 and 143
after SIGINT and SIGTERM, the work so far kept.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from usdmlt import __version__
from usdmlt.cli import bench, compare, doctor, inspect, merge, render, view
from usdmlt.cli.logs import configure_logging

SUBCOMMANDS = (render, merge, view, compare, inspect, bench, doctor)


class Parser(argparse.ArgumentParser):
    """A parser whose complaints are one line."""

    def error(self, message: str) -> NoReturn:
        """Print the line and exit with 2."""
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def build_parser() -> Parser:
    """The parser of all subcommands."""
    parser = Parser(prog="usdmlt", description="Render USD scenes.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"usdmlt {__version__}")
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    for module in SUBCOMMANDS:
        module.add_parser(subparsers)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit status."""
    arguments = build_parser().parse_args(argv)
    configure_logging(getattr(arguments, "verbosity", 0))
    from usdmlt.errors import Error, UsageError

    try:
        status = int(arguments.run(arguments))
        sys.stdout.flush()
        return status
    except UsageError as error:
        return _complain(error, 2)
    except MemoryError:
        return _complain("out of memory", 1)
    except KeyboardInterrupt:
        return _complain("interrupted, nothing was written", 130)
    except BrokenPipeError:
        # The reader of stdout has gone; what is left in the buffer must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (Error, OSError) as error:  # the latter where a temporary file has no room, for instance
        if arguments.verbosity > 0:
            raise
        return _complain(error, 1)


def _complain(message: object, status: int) -> int:
    print(f"usdmlt: error: {' '.join(str(message).split())}", file=sys.stderr)
    return status
