"""`usdmlt compare`: do two pictures show the same?"""

from __future__ import annotations

import argparse
from typing import Any

from usdmlt import files
from usdmlt.cli.logs import add_verbosity
from usdmlt.errors import Error, UsageError


def add_parser(subparsers: Any) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "compare",
        help="say whether two pictures show the same",
        description="Compare two EXRs. Where both have independent batches (references of the "
        "pytest plugin) or error layers, a statistical test decides, with the stated probability "
        "of a false alarm; else every value has to agree, as for idiff. Exit status: 0 the same, "
        "1 different, 2 unreadable or of different size.",
        allow_abbrev=False,
    )
    parser.add_argument("reference", metavar="A.exr")
    parser.add_argument("picture", metavar="B.exr")
    parser.add_argument("--report", metavar="FILE.html", help="write a page that shows both")
    test = parser.add_argument_group("the statistical test")
    test.add_argument(
        "--significance",
        metavar="P",
        type=float,
        default=1e-4,
        help="probability of a false alarm, of the whole picture (default: %(default)g)",
    )
    test.add_argument(
        "--tolerance",
        metavar="X",
        type=float,
        default=1e-4,
        help="relative differences that do not count (default: %(default)g)",
    )
    values = parser.add_argument_group(
        "thresholds, which decide where there are no errors, and besides where they are given"
    )
    values.add_argument(
        "--fail", metavar="X", type=float, help="difference of a pixel (default: 1e-6)"
    )
    values.add_argument(
        "--failpercent", metavar="X", type=float, help="pixels that may (default: 0 %%)"
    )
    values.add_argument("--hardfail", metavar="X", type=float, help="difference that none may have")
    values.add_argument("--flip", metavar="X", type=float, help="mean FLIP")
    add_verbosity(parser)
    parser.set_defaults(run=run, parser=parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what was found; 0 the same, 1 different."""
    try:
        return _compare(arguments)
    except Error as error:  # whose status is 1 elsewhere
        raise UsageError(str(error)) from error


def _compare(arguments: argparse.Namespace) -> int:
    from usdmlt.testing import comparison

    thresholds = _thresholds(arguments)
    if arguments.report:
        files.check_writable(arguments.report)
    result = comparison.compare_files(
        arguments.reference,
        arguments.picture,
        significance=arguments.significance,
        tolerance=arguments.tolerance,
        thresholds=thresholds,
        flip=arguments.flip,
    )
    print("different" if result.different else "the same")
    for line in result.lines():
        print(f"  {line}")
    if arguments.report:
        from usdmlt.testing import report

        command = f"usdmlt compare {arguments.reference} {arguments.picture}"
        entry = report.Entry(arguments.picture, result, {"reproduce": command})
        files.write_text(arguments.report, report.page([report.section(entry)]))
    return int(result.different)


def _thresholds(arguments: argparse.Namespace) -> Any:
    """Those that were given over OpenImageIO's; None where none were."""
    from usdmlt.testing.metrics import Thresholds

    names = ("fail", "failpercent", "hardfail")
    given = {n: getattr(arguments, n) for n in names if getattr(arguments, n) is not None}
    for name, value in given.items() | {("flip", arguments.flip or 0.0)}:
        if not value >= 0:
            raise UsageError(f"--{name} must not be negative, but is {value:g}")
    if not 0 < arguments.significance < 1:
        raise UsageError("--significance must be between 0 and 1")
    if not 0 <= arguments.tolerance < 1:
        raise UsageError("--tolerance must be at least 0 and below 1")
    return Thresholds(**given) if given else None
