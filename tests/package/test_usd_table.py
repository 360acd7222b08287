"""docs/usd-tests.md names tests that exist."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

TESTS = Path(__file__).parent.parent
PAGE = TESTS.parent / "docs" / "usd-tests.md"
ROWS = [line for line in PAGE.read_text("utf-8").splitlines() if re.match(r"\| (?!USD|-)", line)]


@cache
def names_in(file: str) -> set[str]:
    tree = ast.parse((TESTS / file).read_text("utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def missing(row: str) -> list[str]:
    """What a row of the table names and tests/ does not have."""
    wrong = []
    _, tests = row.strip("| ").rsplit(" | ", 1)
    for group in tests.split("; "):
        match = re.fullmatch(r"`([\w/]+\.py)`: (\*all\*|\w+(?:, \w+)*)", group)
        if match is None or not (TESTS / match[1]).is_file():
            wrong.append(group)
            continue
        if match[2] != "*all*":
            there = names_in(match[1])
            wrong += [f"{match[1]}: {n}" for n in match[2].split(", ") if f"test_{n}" not in there]
    return wrong


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.split(" | ")[0].strip("| "))
def test_the_tests_that_a_row_names_exist(row: str) -> None:
    assert missing(row) == []


def test_the_page_has_rows() -> None:
    assert len(ROWS) > 50


@pytest.mark.parametrize(
    "tests",
    [
        "`stage/test_meshes.py`: holes_are_gone",
        "`stage/test_no_such.py`: *all*",
        "`stage/test_meshes.py`: holes_are_left_out; holes",
    ],
)
def test_a_test_that_is_not_there_is_found(tests: str) -> None:
    assert missing(f"| holes | {tests} |")
