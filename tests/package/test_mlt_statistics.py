"""What a render by Metropolis light transport says about itself."""

from __future__ import annotations

import json

import numpy as np
import pytest

import usdmlt
from support import scenes
from support.shapes import perspective, quad, translate
from usdmlt import scene as s
from usdmlt.settings import MUTATIONS

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def image() -> usdmlt.Image:
    """All light but the direct one by chains."""
    return usdmlt.render(
        scenes.build("smooth_glass"), mutations=256, filter="box", depth=8, selective=False
    )


def test_the_numbers_of_the_chains_are_there_and_fit_together(image: usdmlt.Image) -> None:
    stats = image.stats
    assert stats["integrator"] == "mlt"
    # Units are whole: the work that was asked for, and less than one unit more.
    units = stats["units_total"]
    assert stats["samples_per_pixel"] * (units - 1) / units < 256 <= stats["samples_per_pixel"]
    chains = 1 - stats["share_of_bidirectional_samples"]
    assert stats["mutations"] == pytest.approx(stats["samples_per_pixel"] * 24 * 16 * chains)
    assert 0.7 < chains < 0.8
    assert stats["mutations_per_second"] == pytest.approx(stats["mutations"] / stats["seconds"])
    assert stats["rays_per_second"] > 0
    assert 0 < stats["b_error"] < stats["b"]
    assert stats["bootstrap_samples"] > 0
    assert stats["chains"] > 1
    assert 0 < stats["longest_rejection"] <= stats["mutations"] / stats["chains"]
    assert stats["non_finite"] == 0


def test_every_mutation_says_how_often_it_was_tried_and_accepted(image: usdmlt.Image) -> None:
    rows = image.stats["mutation"]
    assert tuple(rows) == MUTATIONS
    for name, row in rows.items():
        if name.startswith("glossy"):  # nothing here is
            assert row["applicable"] == row["proposed"] == row["accepted"] == 0
            continue
        assert row["applicable"] >= row["proposed"] >= row["made"] >= row["accepted"] > 0
        # Accepted with probability a each: the count is Σ a to five standard deviations.
        expected = row["mean_acceptance"] * row["proposed"]
        assert abs(row["accepted"] - expected) <= 5 * np.sqrt(expected)
    assert sum(row["proposed"] for row in rows.values()) == image.stats["mutations"]
    assert sum(row["weight"] for row in rows.values()) == pytest.approx(1)


def test_unused_mutations_are_never_proposed() -> None:
    weights = {"new_path": 3, "lens": 1}
    image = usdmlt.render(scenes.build("diffuse_box"), mutations=64, mutation_weights=weights)
    rows = image.stats["mutation"]
    assert {name for name, row in rows.items() if row["proposed"]} == {"new_path", "lens"}
    assert (rows["new_path"]["weight"], rows["lens"]["weight"]) == (0.75, 0.25)


def test_energy_by_class_is_energy_by_length(image: usdmlt.Image) -> None:
    """The chains have what is longer than two edges; the rest is path traced."""
    energies = image.stats["path_length_energy"]
    by_length = np.zeros(len(energies))
    for name, energy in image.stats["path_class_energy"].items():
        assert set(name[1:-1]) <= set("DS")
        assert (name[0], name[-1]) == ("L", "E")
        by_length[len(name) - 1] += energy
    np.testing.assert_allclose(by_length[3:], energies[3:], rtol=1e-9)
    assert not by_length[:3].any()
    assert energies[2] > 0


@pytest.mark.parametrize("selective", [False, True], ids=["all by chains", "split"])
@pytest.mark.parametrize("scene", ["diffuse_box", "behind a slit"])
def test_the_energies_add_up_to_the_picture(scene: str, selective: bool) -> None:
    """Also where many units find no light at all, and so make no step."""
    built = behind_a_slit() if scene == "behind a slit" else scenes.build(scene)
    options = {"mutations": 256, "direct": "mlt", "filter": "box", "depth": 5}
    image = usdmlt.render(built, selective=selective, **options)
    chains = 1 - image.stats["share_of_bidirectional_samples"]
    planned = image.stats["samples_per_pixel"] * 24 * 16 * chains
    assert (image.stats["mutations"] < 0.99 * planned) == (scene == "behind a slit")
    mean = float((image["color"].astype(np.float64) @ LUMINANCE).mean())
    assert sum(image.stats["path_length_energy"]) == pytest.approx(mean, rel=1e-5)
    assert sum(image.stats["path_class_energy"].values()) == pytest.approx(mean, rel=1e-5)


def behind_a_slit() -> s.Scene:
    """A room above a lid; the lamp is below, and a slit of 2 mm lets through what it sends up."""
    slit = 0.001
    sides = [((-3, -1, -3), (6, 0, 0)), ((-3, -1, 3), (6, 0, 0)), ((-3, -1, -3), (0, 0, 6)),
             ((3, -1, -3), (0, 0, 6))]  # fmt: skip
    return scenes.picture_of(
        perspective((0, 2, 4), (0, 2, 0), 40),
        meshes=[
            quad((-3, 1, -3), (3 - slit, 0, 0), (0, 0, 6)),
            quad((slit, 1, -3), (3 - slit, 0, 0), (0, 0, 6)),
            quad((-3, -1, -3), (6, 0, 0), (0, 0, 6)),
            quad((-3, 4, -3), (6, 0, 0), (0, 0, 6)),
            quad((-3, 1, -3), (6, 0, 0), (0, 3, 0)),
            *(quad(corner, edge, (0, 2, 0)) for corner, edge in sides),
        ],
        materials=[scenes.WHITE],
        lights=[s.SphereLight((50, 50, 50), 0.2, translate(2, -0.5, 0))],
    )


@pytest.mark.parametrize("name", ["opacity", "dome_and_distant", "orthographic_camera", "layers"])
def test_statistics_are_json_whatever_the_scene(name: str) -> None:
    image = usdmlt.render(scenes.build(name), mutations=16)
    assert json.loads(json.dumps(image.stats, allow_nan=False)) == image.stats
    assert np.isfinite(image["color"]).all()
    assert np.isfinite(image["error"]).all()


def test_progress_counts_mutations_and_ends_with_all_of_them() -> None:
    told: list[usdmlt.Progress] = []
    image = usdmlt.render(scenes.build("diffuse_box"), mutations=100, progress=told.append)
    assert told[-1].units_done == told[-1].units_total
    assert told[-1].samples_done == pytest.approx(image.stats["samples_per_pixel"] * 24 * 16)
    assert told[-1].samples_done >= 100 * 24 * 16
    assert {p.samples_are for p in told} == {"mutations"}


def test_without_error_there_is_no_layer_and_the_picture_is_the_same() -> None:
    scene = scenes.build("diffuse_box")
    for integrator in ("path", "bdpt", "mlt"):
        with_error = usdmlt.render(scene, integrator=integrator, samples=4)
        without = usdmlt.render(scene, integrator=integrator, samples=4, error=False)
        assert with_error["error"].shape == (16, 24)
        assert with_error["error"].dtype == np.float32
        assert "error" not in without.channels
        np.testing.assert_array_equal(without["color"], with_error["color"])
