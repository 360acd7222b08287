"""`--error`: renders end when they are good enough, with the same bits wherever they are made."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import numpy as np
import pytest

import usdmlt
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


def test_the_command_line_resumes_to_a_smaller_error(usdmlt_command: Run, stage, tmp_path) -> None:
    flags = ["-w", 48, "--integrator", "path"]
    run = ["render", stage, "a.exr", *flags, "--checkpoint", "c.exr"]
    done = usdmlt_command(*run, "--error", 0.1)
    assert done.returncode == 0, done.stderr
    assert "path, error 0.1, depth" in done.stderr
    assert "goes on" not in done.stderr
    more = usdmlt_command(*run, "--error", 0.05, "--resume")
    assert more.returncode == 0, more.stderr
    usdmlt_command("render", stage, "b.exr", *flags, "--error", 0.05)
    a, b = (usdmlt.read_image(tmp_path / name) for name in ("a.exr", "b.exr"))
    assert a.metadata["units"] == b.metadata["units"]
    np.testing.assert_array_equal(a["color"], b["color"])
    again = usdmlt_command("render", "--from", "b.exr", "again.exr")
    assert again.returncode == 0, again.stderr
    np.testing.assert_array_equal(usdmlt.read_image(tmp_path / "again.exr")["color"], b["color"])


@pytest.mark.parametrize("target", [0, -1, float("nan"), float("inf")])
def test_targets_that_make_no_sense_are_usage_errors(target) -> None:
    with pytest.raises(UsageError, match="target_error must be positive"):
        usdmlt.Settings(target_error=target)


def test_a_target_needs_the_error() -> None:
    with pytest.raises(UsageError, match="needs the layer of the error"):
        usdmlt.Settings(target_error=0.1, error=False)
