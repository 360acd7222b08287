"""The choice among lights."""

import numpy as np
import pytest

from usdmlt import scene


@pytest.fixture
def mixed(placed):
    """One light of each family."""
    return [
        scene.RectLight((1.0, 2.0, 3.0), 2.0, 1.0, placed(position=(0, 0, 3.0))),
        scene.DiskLight((1.0, 1.0, 1.0), 0.7, placed(position=(3.0, 0, 3.0))),
        scene.SphereLight((1.0, 1.0, 1.0), 0.7, placed(position=(0, 3.0, 0))),
        scene.CylinderLight((1.0, 0.5, 1.0), 0.3, 2.0, placed(position=(0, -3.0, 0))),
        scene.DistantLight((1.0, 1.0, 1.0), 20.0),
        scene.DistantLight((0.3, 0.3, 0.3), 0.0),
        scene.DomeLight((0.02, 0.02, 0.02)),
    ]


def test_lights_are_chosen_in_proportion_to_their_power(mixed, probe, uniform):
    lights = probe(*mixed, radius=2.0)
    n = 1_000_000
    points, _ = lights.sample_point(uniform(n))
    probability = lights.power / lights.power.sum()
    environment = points["infinite"] & ~points["delta"]
    for i in (0, 1, 2, 3, 5):
        found = ((points["light"] == i) & ~environment).mean()
        assert found == pytest.approx(probability[i], abs=5 * np.sqrt(probability[i] / n))
    together = probability[4] + probability[6]
    assert environment.mean() == pytest.approx(together, abs=5 * np.sqrt(together / n))


def test_densities_contain_the_choice(mixed, probe, uniform):
    lights = probe(*mixed, radius=2.0)
    alone = probe(mixed[2])
    points, pdf = lights.sample_point(uniform(1000))
    of_sphere = points["light"] == 2
    expected = lights.power[2] / lights.power.sum() / (4 * np.pi * 0.49)
    assert pdf[of_sphere] == pytest.approx(expected, rel=1e-5)
    assert alone.sample_point(uniform(10))[1] == pytest.approx(1 / (4 * np.pi * 0.49), rel=1e-5)


def test_black_lights_are_never_chosen(probe, uniform):
    lights = probe(
        scene.SphereLight((0.0, 0.0, 0.0)),
        scene.SphereLight((1.0, 1.0, 1.0)),
        scene.DomeLight((0.0, 0.0, 0.0)),
        scene.SphereLight((0.0, 0.0, 0.0)),
    )
    assert lights.power[[0, 2, 3]] == pytest.approx(0)
    points, pdf = lights.sample_point(uniform(100_000))
    assert (points["light"] == 1).all() and (pdf > 0).all()


def test_without_light_there_are_no_samples(probe, uniform):
    for lights in (probe(), probe(scene.DiskLight((0.0, 0.0, 0.0)))):
        assert (lights.sample_point(uniform(10))[1] == 0).all()
        assert (lights.sample_direct(np.zeros((1, 3), np.float32), uniform(10))[1] == 0).all()


@pytest.mark.parametrize(
    "light",
    [
        scene.RectLight((1.0, 1.0, 1.0), 0.0, 1.0),
        scene.RectLight((1.0, 1.0, 1.0), 1.0, 1.0, np.diag([1.0, 0.0, 1.0, 1.0])),
        scene.DiskLight((1.0, 1.0, 1.0), 0.0),
        scene.SphereLight((1.0, 1.0, 1.0), 0.0),
        scene.SphereLight((1.0, 1.0, 1.0), 1.0, np.diag([1.0, 1.0, 0.0, 1.0])),
        scene.CylinderLight((1.0, 1.0, 1.0), 0.0, 1.0),
        scene.CylinderLight((1.0, 1.0, 1.0), 1.0, 0.0),
    ],
    ids=lambda light: type(light).__name__,
)
def test_degenerate_shapes_have_no_power_and_are_not_hit(light, probe, uniform):
    lights = probe(light)
    assert lights.power[0] == 0
    assert (lights.sample_point(uniform(10))[1] == 0).all()
    directions = np.random.default_rng(1).normal(size=(100, 3)).astype(np.float32)
    t, _ = lights.intersect_shape(0, np.array([[0.1, 0.2, -3.0]], np.float32), directions)
    assert np.isinf(t).all()


def test_the_same_numbers_give_the_same_points(mixed, probe, uniform):
    u = uniform(10_000)
    first, second = (probe(*mixed) for _ in range(2))
    reference = np.array([[0.3, 0.2, 0.1]], np.float32)
    for a, b in (
        (first.sample_point(u), second.sample_point(u)),
        (first.sample_direct(reference, u), second.sample_direct(reference, u)),
    ):
        assert np.array_equal(a[0], b[0]) and np.array_equal(a[1], b[1])


def test_a_choice_among_very_many_lights_is_fair(placed, probe, uniform):
    """Few of a float's 24 bits remain after it: more are made from the other numbers."""
    count = 10_000
    lights = probe(*(scene.DiskLight((1.0, 1.0, 1.0), 0.1 + 0.1 * (i % 2)) for i in range(count)))
    n = 1_000_000
    points, _ = lights.sample_point(uniform(n))
    drawn = np.bincount(points["light"], minlength=count).reshape(-1, 2).sum(0) / n
    assert drawn == pytest.approx([0.2, 0.8], abs=5 * np.sqrt(0.2 / n))
    # What is left of the number after the choice is uniform too.
    uv = points["uv"][points["light"] % 2 == 1]
    assert (uv**2).sum(1).mean() == pytest.approx(0.5, abs=2e-3)
