"""`usdmlt doctor`: what is installed, what the machine has, and what is missing."""

from __future__ import annotations

import argparse
import os
import platform
import sys
from collections.abc import Callable, Iterator
from typing import Any

from usdmlt import __version__, cpu
from usdmlt.cli.logs import add_verbosity
from usdmlt.settings import available_processors

REQUIRED = ("numpy", "usd-core", "embreex", "OpenImageIO", "colour-science", "rich")
OPTIONAL = ("pytest", "flip-evaluator", "scipy", "mitsuba")


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "doctor",
        help="say what is installed and what is missing",
        description="Print versions, processor, Embree and threads; exit 1 if something that is "
        "needed is missing.",
        allow_abbrev=False,
    )
    add_verbosity(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the table; 1 if something is missing, else 0."""
    healthy = True
    for name, value, problem in examine():
        healthy = healthy and problem is None
        print(f"{name:<16}{value if problem is None else f'MISSING: {problem}'}")
    print("all that is needed is there" if healthy else "something is missing: see above")
    return 0 if healthy else 1


def examine() -> Iterator[tuple[str, str, str | None]]:
    """Rows of name, value and, where something needed is missing, what is wrong."""
    from usdmlt import embree, native

    yield "usdmlt", __version__, None
    yield "python", f"{platform.python_version()} ({sys.executable})", None
    yield "system", platform.platform(), None
    yield "processor", cpu.model_name(), cpu.complaint()
    yield "threads", f"{available_processors()} of {os.cpu_count()} processors", None
    for name in REQUIRED:
        version = _version(name)
        problem = f"pip install {name}" if version is None else None
        yield name, version or "", problem
    for name in OPTIONAL:
        yield name, _version(name) or "not installed (optional)", None
    yield _try("core", lambda: _describe_build(native.build_info()))
    yield _try("Embree", lambda: f"{native.embree_version()} ({embree.find_library()})")


def _try(name: str, value: Callable[[], str]) -> tuple[str, str, str | None]:
    from usdmlt.errors import Error

    try:
        return name, value(), None
    except Error as error:
        return name, "", str(error)


def _describe_build(info: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in info.items())


def _version(distribution: str) -> str | None:
    from importlib import metadata

    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
