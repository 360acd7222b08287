"""Path tracing, bidirectional path tracing and chains make the same pictures of media.

Bidirectional tracing has points of media in every strategy, path tracing in two, and chains move
them by all mutations; a density or factor that one of them has wrong biases its picture alone. What
all three have in common is shown by pictures that are known exactly, see test_transmittance and its
neighbours. Welch's t-tests as in test_path_equals_bdpt, each question at the significance 10⁻³.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from support.media_scenes import LIT_SCENES, MEDIA_SCENES
from support.mutations import MUTATIONS
from support.rendering import ALL, build, picture, pictures, plan, rgba
from support.scenes import WHITE, picture_of
from support.shapes import floor, perspective, translate
from support.statistics import Agreement, agreement
from usdmlt import scene as s

DEPTH = 6
# Where few paths carry much light: with few samples that of single pixels is skewed, more than
# t-tests take for noise.
HARD = {"fog_room", "glass_ball_in_fog", "thick_fog"}
RARE = {"milk", "fire"}  # whose longer paths carry much light in few samples
ALL_QUESTIONS = ("pixels", "blocks", "mean")
SKEWED = ("blocks", "mean")


@cache
def built(name: str):
    return build(MEDIA_SCENES[name]())


@cache
def reference(name: str, seeds: int, samples: int, **settings: object) -> np.ndarray:
    settings = {"depth": DEPTH, **settings}
    return pictures(built(name), "bdpt", range(1000, 1000 + seeds), samples=samples, **settings)


def chains(name: str, seeds: int | Iterable[int], samples: int, **settings: object) -> np.ndarray:
    """Everything is left to the chains, unless the settings say otherwise."""
    settings = {"depth": DEPTH, "direct": "mlt", "selective": False, **settings}
    return pictures(built(name), "mlt", seeds, samples=samples, **settings)


def of_paths(name: str, seeds: int, samples: int, **settings: object) -> Agreement:
    settings = {"depth": DEPTH, **settings}
    path = pictures(built(name), "path", seeds, samples=2 * samples, **settings)
    return agreement(path, reference(name, seeds, samples, **settings))


@pytest.mark.parametrize("name", MEDIA_SCENES)
def test_path_equals_bdpt(name: str) -> None:
    got = of_paths(name, 16, 24 if name in HARD else 12)
    questions = SKEWED if name in HARD else ALL_QUESTIONS
    got.require(resolution=0.025, block_resolution=0.08, questions=questions)


@pytest.mark.parametrize("name", MEDIA_SCENES)
def test_chains_equal_bdpt(name: str) -> None:
    got = chains(name, 16, 24)
    other = reference(name, 16, 24 if name in HARD else 12)
    agreement(got, other, lumpy=True).require(resolution=0.08, block_resolution=0.18)


@pytest.mark.parametrize("edges", [2, 3, 4])
@pytest.mark.parametrize("name", ["glass_ball_in_fog", "blue_air"])
def test_each_path_length_agrees(name: str, edges: int) -> None:
    """Errors of two lengths could cancel in the sum."""
    lengths = {"min_edges": edges, "depth": edges}
    of_paths(name, 16, 12, **lengths).require(resolution=0.05, questions=SKEWED)
    got, other = chains(name, 16, 16, **lengths), reference(name, 16, 12, **lengths)
    agreement(got, other, lumpy=True).require(resolution=0.06, questions=SKEWED)


VARIANTS = {
    "two stages": {"two_stage": True},
    "direct light apart": {"direct": "separate", "two_stage": True},
    "split": {"direct": "separate", "two_stage": True, "selective": True},
    "split of all": {"selective": True},
}


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", ["smoke"])
def test_variants_of_chains_equal_bdpt(name: str, variant: str) -> None:
    """What is traced apart must be what chains leave out, in the filter's margin too."""
    got = chains(name, 16, 24, filter="gaussian", **VARIANTS[variant])
    other = reference(name, 16, 24, filter="gaussian")
    agreement(got, other, lumpy=True).require(resolution=0.04, block_resolution=0.15)


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("name", ["smoke", "overlapping", "fire"])
def test_any_number_of_threads_makes_the_same_bits(name: str, integrator: str) -> None:
    settings = {"samples": 32 if integrator == "mlt" else 4, "filter": "gaussian", "seed": 7}
    one, two = (rgba(built(name), integrator, threads, **settings) for threads in (1, 2))
    assert one[..., :3].any() and np.array_equal(one, two)


@pytest.mark.parametrize("name", MEDIA_SCENES)
def test_paths_of_one_edge_are_the_same_samples(name: str) -> None:
    """They have one strategy, on the same rays."""
    path, bdpt = (picture(built(name), i, samples=4, depth=1) for i in ("path", "bdpt"))
    np.testing.assert_allclose(path, bdpt, rtol=1e-5)


@pytest.mark.parametrize("integrator", ALL)
def test_points_a_few_roundings_apart_make_finite_samples(integrator: str) -> None:
    """Moves that rounding undoes have no density, and points that coincide no direction."""
    x, y, z = place = (100, 200, 300)
    tiny = picture_of(
        perspective((x, y, z + 0.02), place, 40),
        meshes=[floor(0, half=400)],  # the middle of all is far from the camera
        materials=[WHITE],
        lights=[s.SphereLight((1, 1, 1), 0.005, translate(*place))],
        media=[s.Medium((100, 100, 100))],
        world_medium=0,
    )
    variants = [{}, {"selective": False}] if integrator == "mlt" else [{}]
    for variant in variants:
        assert picture(tiny, integrator, samples=256, depth=4, **variant).any()


# ---- With many samples ------------------------------------------------------------------------

MANY = (96, 256)


@pytest.mark.slow
@pytest.mark.parametrize("name", MEDIA_SCENES)
def test_path_equals_bdpt_with_many_samples(name: str) -> None:
    got = of_paths(name, 24, MANY[name in HARD])
    print(f"{name:20} path  {got}")
    got.require(resolution=0.01, block_resolution=0.025)


@pytest.mark.slow
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", LIT_SCENES)
def test_variants_of_chains_equal_bdpt_with_many_mutations(name: str, variant: str) -> None:
    got = chains(name, 16, 256, filter="gaussian", **VARIANTS[variant])
    other = reference(name, 16, 256 if name in HARD else 96, filter="gaussian")
    answer = agreement(got, other, lumpy=True)
    print(f"{name:20} {variant:20} {answer}")
    answer.require(resolution=0.03, block_resolution=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", MEDIA_SCENES)
def test_chains_equal_bdpt_with_many_mutations(name: str) -> None:
    other = reference(name, 24, MANY[name in HARD])
    got = agreement(chains(name, 24, 1024), other, lumpy=True)
    print(f"{name:20} mlt   {got}")
    got.require(resolution=0.015 if name in HARD else 0.008, block_resolution=0.025)


@pytest.mark.slow
@pytest.mark.parametrize("edges", [2, 3, 4, 5])
@pytest.mark.parametrize("name", MEDIA_SCENES)
def test_each_path_length_agrees_with_many_samples(name: str, edges: int) -> None:
    lengths = {"min_edges": edges, "depth": edges}
    samples = 512 if name in RARE else 128
    other = reference(name, 24, samples, **lengths)
    assert other.any()
    answers = [of_paths(name, 24, samples, **lengths)]
    if name in LIT_SCENES:
        answers.append(agreement(chains(name, 24, 2 * samples, **lengths), other, lumpy=True))
    for answer in answers:
        print(f"{name:20} {edges} edges {answer}")
        answer.require(resolution=0.04 if name in RARE else 0.03, questions=SKEWED)


REACH_ALL = {"new_path", "bidirectional"}
SETS = [set(c) for n in range(1, len(MUTATIONS) + 1) for c in combinations(MUTATIONS, n)]
GLOSSY = {"glossy_lens", "glossy_caustic"}  # which apply where there is something polished
ADMISSIBLE = [c for c in SETS if c & REACH_ALL]


@pytest.mark.slow
@pytest.mark.parametrize("name", LIT_SCENES)
def test_every_admissible_set_of_mutations(name: str) -> None:
    """As test_mlt_subsets does: the variants alternate, Šidák's correction counts the sets, and
    pixels are judged in the average over all."""
    sharp = reference(name, 24, MANY[name in HARD])
    tried = [c for c in ADMISSIBLE if name == "thick_fog" or not c & GLOSSY]
    significance = -np.expm1(np.log1p(-1e-3) / len(tried))
    pooled = 0.0
    for i, mutations in enumerate(tried):
        variant = {"direct": ("separate", "mlt")[i % 2], "two_stage": i // 2 % 2 == 0}
        weights = dict.fromkeys(mutations, 1.0)
        seeds = range(16 * i, 16 * i + 16)
        # By few, noise of one mutation alone is too skewed for t-tests.
        mutations_per_pixel = 384 if name in HARD else 96
        got = chains(name, seeds, mutations_per_pixel, mutation_weights=weights, **variant)
        pooled = pooled + got / len(tried)
        answer = agreement(got, sharp, lumpy=True)
        print(f"{name:20} {'+'.join(sorted(mutations)):60} {answer}")
        answer.require(significance, resolution=0.15, questions=("blocks", "mean"))
    together = agreement(pooled, sharp, lumpy=True)
    print(f"{name:20} {'all':60} {together}")
    together.require(resolution=0.01, block_resolution=0.03)


def test_statistics_name_classes_with_points_of_media() -> None:
    render = plan(built("blue_air"), "mlt", samples=64, depth=DEPTH, direct="mlt", selective=False)
    render.run(render.units_total)
    energy = render.stats()["mlt"]["path_class_energy"]
    assert energy["LME"] > 0 and energy["LMDE"] > 0 and energy["LDE"] > 0
