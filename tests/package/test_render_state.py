"""Units of a render that were rendered elsewhere: sums of integers, in any order."""

from __future__ import annotations

import random
from itertools import pairwise

import numpy as np
import pytest

import usdmlt
from usdmlt import parts
from usdmlt.errors import Error
from usdmlt.native import core

INTEGRATORS = ("path", "bdpt", "mlt")
AOVS = "direct,indirect,sampleCount"


def rendering(stage, integrator: str, **options: object) -> usdmlt.Rendering:
    settings: dict[str, object] = {"samples": 12, "aovs": AOVS}
    if integrator == "mlt":
        settings |= {"samples": 48, "direct": "mlt"}  # chains have nothing else to do here
    settings |= options
    scene = usdmlt.load(stage, width=96)
    return usdmlt.Rendering(scene, usdmlt.Settings(integrator=integrator, **settings))


def assert_same(a: usdmlt.Rendering, b: usdmlt.Rendering) -> None:
    """The same integers, and the same floats."""
    for name, plane in a.state().sums.items():
        np.testing.assert_array_equal(plane, b.state().sums[name], err_msg=name)
    first, second = a.image(), b.image()
    for name, pixels in first.channels.items():
        np.testing.assert_array_equal(pixels, second[name], err_msg=name)
    timed = {"seconds", "cpu_seconds", "seconds_building", "choice"}
    for name, value in first.stats.items():
        if name not in timed and "_per_" not in name:
            assert value == second.stats[name], name


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_units_in_any_order_from_several_renders_are_the_render_in_one_go(
    stage, integrator
) -> None:
    whole, total = rendering(stage, integrator), rendering(stage, integrator)
    assert whole.run()
    count = whole.units_total
    assert count >= 4
    cuts = sorted({0, 1, count // 3, count // 2, count - 1, count})
    chunks = list(pairwise(cuts))
    random.Random(3).shuffle(chunks)
    for first, last in chunks:
        total.add(rendering(stage, integrator).render_alone(first, last, threads=2))
    assert total.units == [(0, count)]
    assert_same(whole, total)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_states_can_be_summed_before_they_are_added(stage, integrator) -> None:
    from usdmlt.cluster.worker import add

    whole, total = rendering(stage, integrator), rendering(stage, integrator)
    whole.run()
    half = whole.units_total // 2
    part = rendering(stage, integrator)
    a, b = part.render_alone(half, whole.units_total, 1), part.render_alone(0, half, 1)
    total.add(add(a, b))
    assert_same(whole, total)
    with pytest.raises(ValueError, match=f"units 0:{half} are in both"):
        add(b, b)


def test_a_run_fills_the_gaps(stage) -> None:
    whole, gapped = rendering(stage, "bdpt"), rendering(stage, "bdpt")
    whole.run()
    gapped.add(rendering(stage, "bdpt").render_alone(3, 5, 1))
    assert gapped.run()
    assert_same(whole, gapped)


def test_units_are_not_counted_twice(stage) -> None:
    total = rendering(stage, "path")
    state = rendering(stage, "path").render_alone(2, 6, 1)
    total.add(state)
    before = {name: plane.copy() for name, plane in total.state().sums.items()}
    with pytest.raises(Error, match="units 2:6 are there already"):
        total.add(state)
    assert total.units == [(2, 6)]
    for name, plane in total.state().sums.items():
        np.testing.assert_array_equal(plane, before[name])
    with pytest.raises(ValueError, match="done already"):
        total._render.run(8, first_unit=5)


def test_the_sums_of_another_film_are_refused(stage) -> None:
    state = rendering(stage, "bdpt").render_alone(0, 1, 1)
    with pytest.raises(ValueError, match="another film"):
        rendering(stage, "path").add(state)
    small = usdmlt.Rendering(
        usdmlt.load(stage, width=48), usdmlt.Settings(integrator="bdpt", aovs=AOVS)
    )
    with pytest.raises(ValueError, match="another shape"):
        small.add(state)


def test_sums_that_do_not_fit_are_counted() -> None:
    film = core().Film(2, 1, 1.0, 1.0, splats=False, error=False, layers=0)
    sums = {"samples": np.full((1, 2, 5), 2**61, np.int64)}
    film.add(sums)
    assert film.overflows == 0
    film.add(sums)
    assert film.overflows == 10
    assert (film.planes()["samples"] == 2**61).all()


def test_a_film_lends_its_sums_to_be_read_only(stage) -> None:
    planes = rendering(stage, "bdpt").state().sums
    with pytest.raises(ValueError, match="read-only"):
        planes["samples"][0, 0, 0] = 1


def test_what_units_counted_can_be_summed(stage) -> None:
    one = rendering(stage, "mlt")
    a, b = one.render_alone(0, 2, 1).saved, one.render_alone(2, 4, 1).saved
    both = one.render_alone(0, 4, 1).saved
    sums = parts.added(a, b)
    assert sums["longest_rejection"] == both["longest_rejection"] > 0
    for name in ("units", "statistics", "metropolis", "path_classes"):
        assert list(sums[name]) == list(both[name]), name


def test_plans_that_differ_have_other_digests(stage) -> None:
    first, again, other = (rendering(stage, "mlt", seed=seed) for seed in (1, 1, 2))
    assert first._render.plan_digest == again._render.plan_digest
    assert first._render.plan_digest != other._render.plan_digest
