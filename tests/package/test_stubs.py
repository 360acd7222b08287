"""The type stubs of the core name what the core has, but for its probes."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import usdmlt
from usdmlt.native import core

STUBS = ast.parse((Path(usdmlt.__file__).parent / "_core.pyi").read_text())
CLASSES = {node.name: node for node in STUBS.body if isinstance(node, ast.ClassDef)}


def public_names(thing: object) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")}


def test_the_module_has_what_the_stubs_name() -> None:
    functions = {node.name for node in STUBS.body if isinstance(node, ast.FunctionDef)}
    assert functions | set(CLASSES) <= public_names(core())


@pytest.mark.parametrize("name", ["Scene", "Film", "Development", "Render"])
def test_the_classes_have_exactly_what_the_stubs_name(name: str) -> None:
    methods = {n.name for n in CLASSES[name].body if isinstance(n, ast.FunctionDef)}
    assert public_names(getattr(core(), name)) == methods - {"__init__"}
