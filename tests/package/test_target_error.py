"""`--error`: renders end when they are good enough, with the same bits wherever they are made."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable

import numpy as np
import pytest

import usdmlt
from usdmlt.cli.progress import fraction_done, remaining_seconds
from usdmlt.errors import UsageError
from usdmlt.target_error import relative_error

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def rendering(stage, target: float, **settings: object) -> usdmlt.Rendering:
    settings = {"integrator": "path", "target_error": target} | settings
    return usdmlt.Rendering(usdmlt.load(stage, width=48), usdmlt.Settings(**settings))


@pytest.mark.parametrize(("integrator", "error"), [("path", 0.08), ("bdpt", 0.08), ("mlt", 0.02)])
def test_a_render_ends_when_its_error_is_small_enough(stage, integrator, error) -> None:
    targets = error, error / 2
    coarse, fine = (rendering(stage, e, integrator=integrator, direct="mlt") for e in targets)
    for render, target in zip((coarse, fine), targets, strict=True):
        assert not render.run()  # of the units there could be
        assert 0.8 * target < relative_error(render) <= target
    # A half of the error is four times the work.
    assert 2.5 < fine.units_done / coarse.units_done < 6


@pytest.mark.parametrize(
    ("integrator", "target", "least"),
    # Samples of paths are stratified, and better than the estimate knows.
    [("path", 0.08, 0.5), ("mlt", 0.02, 0.75)],
)
def test_the_estimate_is_the_error(stage, integrator, target, least) -> None:
    """Against a picture of much less error; of one seed, so within a part of it."""
    scene = usdmlt.load(stage, width=48)
    reference = usdmlt.render(scene, integrator="path", samples=6000, seed=9)["color"]
    weights = np.array([0.2126, 0.7152, 0.0722])
    true = reference.astype(np.float64) @ weights
    coarse = rendering(stage, target, integrator=integrator, direct="mlt")
    coarse.run()
    made = coarse.image()["color"].astype(np.float64) @ weights
    actual = np.sqrt(np.mean((made - true) ** 2 / (true**2 + 0.01 * true.mean() ** 2)))
    assert least * target < actual < 1.15 * target


def test_it_ends_at_the_same_unit_in_pieces_and_on_other_threads(stage) -> None:
    one, pieces = rendering(stage, 0.06, threads=1), rendering(stage, 0.06, threads=2)
    one.run()
    for until in (5, 17, 18, None):
        pieces.run(until=until)
    assert pieces.units == one.units
    np.testing.assert_array_equal(pieces.image()["color"], one.image()["color"])
    assert not pieces.run()
    assert pieces.units == one.units


def test_samples_end_it_before(stage) -> None:
    short = rendering(stage, 1e-6, samples=20)
    assert short.run()


@pytest.mark.parametrize(("integrator", "target"), [("path", 0.04), ("mlt", 0.01)])
def test_progress_and_the_time_left_are_those_towards_the_target(stage, integrator, target) -> None:
    """Within a tenth of the whole, which is how far a look is from the next."""
    whole, part = (rendering(stage, target, integrator=integrator) for _ in range(2))
    told: list[usdmlt.Progress] = []
    whole.run(told.append)
    assert fraction_done(told[-1], None) == 1 and remaining_seconds(told[-1], None) == 0
    assert all(fraction_done(made, None) < 1 for made in told[:-1])
    for share in (0.25, 0.5, 0.75):
        part.run(until=round(share * whole.units_done))
        made = part.progress(part.units_done, part.units_total, 60.0 * share, 0)
        assert fraction_done(made, None) == pytest.approx(share, abs=0.1)
        assert remaining_seconds(made, None) == pytest.approx(60.0 * (1 - share), abs=9)
        assert fraction_done(made, 100.0 * share) == pytest.approx(max(share, 0.6), abs=0.1)
        assert remaining_seconds(made, 60.0 * share + 1) == 1
    # All units are done that seemed to be needed, and the error has not been looked at again.
    late = part.progress(made.units_total, part.units_total, 60.0, 0)
    assert 0.9 < fraction_done(late, None) < 1


@pytest.mark.parametrize("samples", [32, 256])  # of the first, the error is never looked at
def test_samples_are_the_progress_where_they_end_it_before(stage, samples) -> None:
    short = rendering(stage, 1e-6, samples=samples)
    short.run(until=short.units_total // 2)
    made = short.progress(short.units_done, short.units_total, 10.0, 0)
    assert fraction_done(made, None) == pytest.approx(0.5, abs=0.01)
    assert remaining_seconds(made, None) == pytest.approx(10.0, rel=0.05)


def test_the_time_left_of_a_resumed_render_is_by_its_own_work(stage) -> None:
    whole, before, resumed = (rendering(stage, 0.03) for _ in range(3))
    whole.run()
    before.run(until=whole.units_done // 2)
    resumed.add(before.state())
    told: list[usdmlt.Progress] = []
    resumed.run(told.append, until=3 * whole.units_done // 4)
    made = resumed.progress(resumed.units_done, resumed.units_total, 10.0, told[-1].units_before)
    assert fraction_done(made, None) == pytest.approx(0.75, abs=0.1)
    assert remaining_seconds(made, None) == pytest.approx(10.0, abs=4)  # 3.3 by all work


@pytest.mark.parametrize(("units", "settings"), [(31, {}), (32, {"depth": 1})])
def test_no_time_is_left_to_tell_before_a_look_at_what_is_not_black(stage, units, settings) -> None:
    begun = rendering(stage, 0.01, **settings)
    begun.run(until=units)
    made = begun.progress(begun.units_done, begun.units_total, 10.0, 0)
    assert made.units_done == units and fraction_done(made, None) < 0.01
    assert remaining_seconds(made, None) is None
    assert remaining_seconds(made, 15.0) == 5


def test_the_command_line_resumes_to_a_smaller_error(usdmlt_command: Run, stage, tmp_path) -> None:
    flags = ["-w", 48, "--integrator", "path"]
    run = ["render", stage, "a.exr", *flags, "--checkpoint", "c.exr"]
    done = usdmlt_command(*run, "--error", 0.1)
    assert done.returncode == 0, done.stderr
    assert "path, error 0.1, depth" in done.stderr
    assert "goes on" not in done.stderr
    more = usdmlt_command(*run, "--error", 0.05, "--resume", "--progress", "json")
    assert more.returncode == 0, more.stderr
    last = json.loads(more.stdout.splitlines()[-1])
    assert last["fraction"] == 1 and last["remaining_seconds"] == 0
    usdmlt_command("render", stage, "b.exr", *flags, "--error", 0.05)
    a, b = (usdmlt.read_image(tmp_path / name) for name in ("a.exr", "b.exr"))
    assert a.metadata["units"] == b.metadata["units"]
    np.testing.assert_array_equal(a["color"], b["color"])
    again = usdmlt_command("render", "--from", "b.exr", "again.exr")
    assert again.returncode == 0, again.stderr
    np.testing.assert_array_equal(usdmlt.read_image(tmp_path / "again.exr")["color"], b["color"])


@pytest.mark.parametrize("target", [0, -1, float("nan"), float("inf")])
def test_targets_that_make_no_sense_are_usage_errors(target) -> None:
    with pytest.raises(UsageError, match="target_error must be a positive number"):
        usdmlt.Settings(target_error=target)


def test_a_target_needs_the_error() -> None:
    with pytest.raises(UsageError, match="needs the layer of the error"):
        usdmlt.Settings(target_error=0.1, error=False)
