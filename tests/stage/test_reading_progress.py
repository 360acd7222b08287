"""Whoever waits for a large stage hears how far reading is."""

from __future__ import annotations

import pytest

from usdmlt.stage import load, reading_progress

STAGE = """
def Cube "a" {}
def Xform "x" { def Mesh "empty" {} }
def "i" ( instanceable = true
    references = </Class> ) {}
class "Class" { def Sphere "s" {}
    def Cone "c" {} }
def SphereLight "l" {}
"""


@pytest.mark.parametrize(("seconds", "heard"), [(0.0, [1, 2, 3, 4]), (3600.0, [4])])
def test_prims_of_geometry_are_counted_now_and_then(write, monkeypatch, seconds, heard):
    monkeypatch.setattr(reading_progress, "SECONDS_BETWEEN", seconds)
    calls = []
    load(write(STAGE), progress=lambda done, total: calls.append((done, total)))
    assert calls == [(done, 4) for done in heard]
