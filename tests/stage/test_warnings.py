"""Warnings: one per kind, on the usdmlt logger, naming the first prims; errors when strict."""

from __future__ import annotations

import logging

import pytest

from usdmlt.errors import Error, Report, Warning
from usdmlt.stage import load

FIVE = "\n".join(f'def FluffyCloud "p{i}" {{}}' for i in range(5)) + '\ndef Cube "c" {}\n'


def test_a_kind_is_logged_once_with_the_first_prims_and_the_count(write, caplog):
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        load(write(FIVE))
    messages = [r.getMessage() for r in caplog.records if "FluffyCloud" in r.getMessage()]
    assert messages == ["FluffyCloud prims are not rendered: /p0, /p1, /p2 and 2 more"]


def test_the_first_of_a_kind_is_an_error_when_strict(write):
    with pytest.raises(Error, match="/p0: FluffyCloud prims are not rendered"):
        load(write(FIVE), strict=True)


def test_what_is_rendered_as_authored_logs_nothing(write, caplog):
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        load(write('def Mesh "m" { QUAD }\ndef SphereLight "l" {}'))
    assert caplog.records == []


def test_warnings_read_as_one_line():
    assert str(Warning("odd things", ["/a", "/b"])) == "odd things: /a, /b"
    assert str(Warning("odd things", list("abcde"))) == "odd things: a, b, c and 2 more"
    assert str(Warning("odd things")) == "odd things"


def test_the_same_prim_is_named_once_per_kind():
    report = Report()
    for _ in range(3):
        report.warn("odd things", "/a")
    assert report.warnings == [Warning("odd things", ["/a"])]


def test_notes_are_never_errors():
    report = Report(strict=True)
    report.note("chosen for you", "/a")
    assert [w.kind for w in report.warnings] == ["chosen for you"]
