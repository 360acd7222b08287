"""How far reading and rendering are: a bar on a terminal, lines elsewhere, or for programs."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from usdmlt.rendering import Progress
    from usdmlt.settings import Settings

logger = logging.getLogger("usdmlt")

SECONDS_BETWEEN_LINES = 10.0
SECONDS_BETWEEN_RECORDS = 1.0

ProgressStyle = Literal["plain", "json", "alfred"]


@contextmanager
def display(
    settings: Settings, style: ProgressStyle | None, quiet: bool
) -> Iterator[Callable[[Progress], None] | None]:
    """A function that shows the progress of rendering it is called with; None when quiet.

    What is for programs goes to stdout, quiet or not.
    """
    if style == "json":
        yield _records(settings)
    elif style == "alfred":
        yield _alfred(settings)
    else:
        with _display(style, quiet) as show:
            if show is None:
                yield None
                return

            def show_rendering(progress: Progress) -> None:
                show(fraction_done(progress, settings.time), describe(progress, settings.time))

            yield show_rendering


@contextmanager
def display_reading(
    style: ProgressStyle | None, quiet: bool
) -> Iterator[Callable[[int, int], None] | None]:
    """The same for the prims of a stage that are read, of how many; programs are not told."""
    with _display(style, quiet or style in ("json", "alfred")) as show:
        if show is None:
            yield None
            return

        def show_reading(done: int, total: int) -> None:
            show(done / total, f"{done:,} of {total:,} prims read")

        yield show_reading


@contextmanager
def _display(
    style: ProgressStyle | None, quiet: bool
) -> Iterator[Callable[[float, str], None] | None]:
    """A function that shows a fraction that is done, and a text; None when quiet."""
    if quiet:
        yield None
    elif style is None and sys.stderr.isatty():
        with _bar() as show:
            yield show
    else:
        yield _lines()


def fraction_done(progress: Progress, time_limit: float | None) -> float:
    """Between 0 and 1: of the units, or of the time if that will be over first."""
    of_units = progress.units_done / max(progress.units_total, 1)
    of_time = progress.seconds / time_limit if time_limit else 0.0
    return min(max(of_units, of_time), 1.0)


def remaining_seconds(progress: Progress, time_limit: float | None) -> float | None:
    """An estimate, by the speed of this run, or None before there is anything to estimate from."""
    left = [] if time_limit is None else [max(time_limit - progress.seconds, 0.0)]
    made = progress.units_done - progress.units_before
    if made > 0 and progress.is_total_known:
        units_left = progress.units_total - progress.units_done
        left.append(progress.seconds * units_left / made)
    return min(left, default=None)


def clock(seconds: float) -> str:
    """`1:02:03`, or `2:03` below an hour."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def describe(progress: Progress, time_limit: float | None) -> str:
    """Rate, elapsed and remaining time."""
    made = (progress.units_done - progress.units_before) * progress.samples_per_unit
    rate = made / max(progress.seconds, 1e-9)
    remaining = remaining_seconds(progress, time_limit)
    left = "" if remaining is None else f", {clock(remaining)} left"
    return f"{_scaled(rate)} {progress.samples_are}/s, {clock(progress.seconds)} elapsed{left}"


def _scaled(rate: float) -> str:
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if rate >= factor:
            return f"{rate / factor:.3g} {prefix}"
    return f"{rate:.0f}"


@contextmanager
def _bar() -> Iterator[Callable[[float, str], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Display

    columns = (BarColumn(), TextColumn("{task.percentage:3.0f} %  {task.fields[text]}"))
    with Display(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("", total=1.0, text="")

        def show(fraction: float, text: str) -> None:
            shown.update(task, completed=fraction, text=text)

        yield show


def _lines() -> Callable[[float, str], None]:
    last = perf_counter()

    def show(fraction: float, text: str) -> None:
        nonlocal last
        if perf_counter() - last >= SECONDS_BETWEEN_LINES:
            last = perf_counter()
            logger.info("%.0f %%, %s", 100 * fraction, text)

    return show


def _records(settings: Settings) -> Callable[[Progress], None]:
    """JSON, an object a line: once a second, and at the end."""
    last = perf_counter()

    def show(progress: Progress) -> None:
        nonlocal last
        is_last = progress.units_done == progress.units_total
        if is_last or perf_counter() - last >= SECONDS_BETWEEN_RECORDS:
            last = perf_counter()
            print(json.dumps(record(progress, settings.time)), flush=True)

    return show


def record(progress: Progress, time_limit: float | None) -> dict[str, Any]:
    """The progress as JSON has it; ``fraction`` is of the units, or of the time."""
    return {
        "fraction": fraction_done(progress, time_limit),
        "units_done": progress.units_done,
        "units_total": progress.units_total,
        progress.samples_are: progress.samples_done,
        "seconds": progress.seconds,
        "remaining_seconds": remaining_seconds(progress, time_limit),
    }


def _alfred(settings: Settings) -> Callable[[Progress], None]:
    """Whole percents, as Pixar's Alfred and Tractor read them."""
    last = -1

    def show(progress: Progress) -> None:
        nonlocal last
        percent = int(100 * fraction_done(progress, settings.time))
        if percent != last:
            last = percent
            print(f"ALF_PROGRESS {percent}%", flush=True)

    return show
