"""What the progress display says."""

from __future__ import annotations

import pytest

from usdmlt.cli.progress import clock, describe, fraction_done, remaining_seconds
from usdmlt.rendering import Progress


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
