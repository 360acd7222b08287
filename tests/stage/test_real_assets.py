"""Stages made by others: all of them load, or say in one line why not.

Set USDMLT_ASSETS to a folder with the USD working group's assets to run these.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from usdmlt.errors import Error
from usdmlt.stage import inspect, load

FOLDER = Path(os.environ.get("USDMLT_ASSETS", "/nonexistent"))
FILES = sorted(path for path in FOLDER.rglob("*.usd*") if path.suffix != ".txt")

pytestmark = pytest.mark.skipif(not FILES, reason="USDMLT_ASSETS names no folder of assets")

# Broken on purpose, and what is broken.
REFUSED = {
    "framesPerSecond_-1.usda": "framesPerSecond",
    "framesPerSecond_0.usda": "framesPerSecond",
    "weird_matrix_transform.usda": "singular",
}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_stage_loads_or_says_why_not(path):
    if path.name in REFUSED:
        with pytest.raises(Error, match=REFUSED[path.name]) as raised:
            load(path)
        assert "\n" not in str(raised.value)
    else:
        assert inspect(path).width > 0


@pytest.mark.parametrize(
    ("name", "allowed"),
    [
        ("McUsd.usda", ()),
        ("TextureTransformTest.usd", ("no lights",)),
        ("RoughnessTest.usdz", ("no lights",)),
        ("CesiumMan.usdz", ("no lights",)),
        ("Teapot.usd", ("no lights", "cage")),
    ],
)
def test_warnings_are_about_what_is_unsupported_only(name, allowed):
    path = next((path for path in FILES if path.name == name), None)
    if path is None:
        pytest.skip(f"{name} is not there")
    for warning in inspect(path).warnings:
        assert any(text in warning.kind for text in allowed), warning
