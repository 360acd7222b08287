"""What the progress display says."""

from __future__ import annotations

import io
import logging

import pytest

from usdmlt.cli.progress import (
    clock,
    describe,
    display,
    display_reading,
    fraction_done,
    remaining_seconds,
)
from usdmlt.rendering import Progress
from usdmlt.settings import Settings


def progress(done: int, total: int, seconds: float) -> Progress:
    return Progress(done, total, samples_per_unit=4096, seconds=seconds)


def test_rate_elapsed_and_remaining() -> None:
    assert describe(progress(25, 100, 10.0), None) == "10.2 k samples/s, 0:10 elapsed, 0:30 left"
    assert describe(progress(0, 100, 1.0), None) == "0 samples/s, 0:01 elapsed"


def test_mlt_counts_mutations() -> None:
    assert describe(Progress(1, 4, 5e5, 0.5, "mutations"), None).startswith("1 M mutations/s, ")


def test_the_nearer_of_time_limit_and_units_counts() -> None:
    assert remaining_seconds(progress(25, 100, 10.0), 15.0) == 5
    assert remaining_seconds(progress(25, 100, 10.0), 1000.0) == 30
    assert fraction_done(progress(25, 100, 10.0), 20.0) == 0.5
    assert fraction_done(progress(25, 100, 10.0), None) == 0.25


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0:00"), (59.6, "1:00"), (61, "1:01"), (3723, "1:02:03")]
)
def test_clock(seconds: float, text: str) -> None:
    assert clock(seconds) == text


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_bars_of_reading_and_rendering(monkeypatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    for shown, call, text in (
        (
            lambda quiet: display_reading(None, quiet),
            (1200, 4800),
            "25 %  1,200 of 4,800 prims read",
        ),
        (
            lambda quiet: display(Settings(), None, quiet),
            (progress(25, 100, 10.0),),
            "25 %  10.2 k",
        ),
    ):
        terminal = Terminal()
        monkeypatch.setattr("sys.stderr", terminal)
        with shown(quiet=False) as show:
            show(*call)
        assert text in terminal.getvalue()
        with shown(quiet=True) as show:
            assert show is None


def test_elsewhere_there_is_a_line_now_and_then(monkeypatch, caplog) -> None:
    monkeypatch.setattr("sys.stderr", io.StringIO())
    caplog.set_level(logging.INFO, "usdmlt")
    with display_reading(None, quiet=False) as show:
        show(1, 4)
        assert caplog.messages == []
        monkeypatch.setattr("usdmlt.cli.progress.SECONDS_BETWEEN_LINES", 0.0)
        show(2, 4)
    assert caplog.messages == ["50 %, 2 of 4 prims read"]
