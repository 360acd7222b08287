"""The standard error of the luminance that a render reports, beside the spread over its seeds."""

from __future__ import annotations

import numpy as np
import pytest

from support import scenes
from support.rendering import build, plan
from support.shapes import perspective, quad
from usdmlt import scene as s

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
MANY = 2**14  # samples, of which the first units are rendered


def reported_over_observed(
    name: str, integrator: str, units: int, seeds: int, **settings: object
) -> float:
    """Σ mean reported variance / Σ variance over seeds, pixels weighted by 1 / brightness²."""
    built = build(scenes.build(name))
    luminances, variances = [], []
    for seed in range(seeds):
        render = plan(built, integrator, samples=MANY, seed=seed, **settings)
        render.run(units)
        luminances.append(render.image()[..., :3].astype(np.float64) @ LUMINANCE)
        variances.append(render.error().astype(np.float64) ** 2)
    weight = 1 / (np.mean(luminances, axis=0) ** 2 + 1e-3)
    reported = np.sum(weight * np.mean(variances, axis=0))
    return float(reported / np.sum(weight * np.var(luminances, axis=0, ddof=1)))


@pytest.mark.parametrize("name", ["smooth_glass", "clipped_and_mirrored_camera"])
def test_the_reported_error_of_chains_is_their_spread(name: str) -> None:
    """Units are independent, so they tell the variance. With 384 pixels and 24 seeds the ratio is
    known to some 5 %, clumps in caustics included; squares of splats instead of those of units
    would be seen, and in the second scene an exposure that is not in both."""
    ratio = reported_over_observed(name, "mlt", 21, 24, direct="mlt", selective=False, depth=6)
    assert ratio == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize(("integrator", "units"), [("path", 16), ("bdpt", 16), ("mlt", 21)])
def test_the_reported_error_is_never_too_small(integrator: str, units: int) -> None:
    """Camera samples are stratified, but counted as independent: their error is overestimated, by
    a factor of up to three in the variance here."""
    assert 0.9 < reported_over_observed("diffuse_box", integrator, units, 20, depth=5) < 3


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_four_times_the_work_halves_the_reported_error(integrator: str) -> None:
    render = plan(scenes.build("diffuse_box"), integrator, samples=MANY, depth=4)
    variances = []
    for units in (32, 128):
        render.run(units)
        variances.append(float(np.mean(render.error() ** 2)))
    assert variances[1] / variances[0] == pytest.approx(0.25, rel=0.2)


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_what_does_not_vary_has_no_error(integrator: str) -> None:
    """A wall that glows evenly and reflects nothing, and the dark beside it; pixels on its edge
    have an error."""
    glow = s.Material(s.UniformEmission((3.0, 2.0, 1.0)))
    wall = quad((-1.01, -4, 0), (5, 0, 0), (0, 8, 0))
    scene = s.Scene(perspective((0, 0, 3), (0, 0, 0), 40), 24, 16, meshes=[wall], materials=[glow])
    render = plan(scene, integrator, samples=64)
    render.run(render.units_total)
    alpha, error = render.image()[..., 3], render.error()
    dark, covered = alpha == 0, alpha == 1
    assert dark.sum() > 20
    assert covered.sum() > 20
    assert not error[dark].any()
    # The difference of nearly equal sums of squares, in fixed point.
    assert error[covered].max() < 2e-3
    assert (error[~dark & ~covered] > 0.01).all()


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_faint_light_has_an_error(integrator: str) -> None:
    """Its squares are below what fixed point tells apart: none of its pixels may claim to be exact.
    Two walls, of which one glows ten thousand times less than the other."""
    walls = [quad((x, -4, 0), (5, 0, 0), (0, 8, 0), i) for i, x in enumerate((-5.01, 0.01))]
    glow = [s.Material(s.UniformEmission((v, v, v))) for v in (3.0, 3e-4)]
    scene = s.Scene(perspective((0, 0, 3), (0, 0, 0), 40), 24, 16, meshes=walls, materials=glow)
    render = plan(scene, integrator, samples=64, direct="mlt", selective=False)
    render.run(render.units_total)
    luminance, error = render.image()[..., :3] @ LUMINANCE, render.error()
    faint = luminance[:, 14:]
    assert (faint > 0).sum() > 20
    assert (error[:, 14:][faint > 0] > 0).all()
    assert np.median(error[:, 14:]) < 1e-3 * luminance.mean()


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_without_it_the_picture_is_the_same(integrator: str) -> None:
    built = build(scenes.build("caustics"))
    one, two = (plan(built, integrator, samples=MANY, error_layer=kept) for kept in (True, False))
    for render in (one, two):
        render.run(4)
    assert np.array_equal(one.image(), two.image())


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_too_little_to_tell_is_zero_and_finite(integrator: str) -> None:
    render = plan(scenes.build("diffuse_box"), integrator, samples=MANY)
    assert not render.error().any()  # before any work
    render.run(1)
    assert np.isfinite(render.error()).all()
