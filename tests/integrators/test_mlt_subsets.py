"""Any set of mutations makes the same picture.

A set that holds the new path or the bidirectional mutation reaches every path. As chains start from
their own bootstrap, distributed as the target is, even a set that does not reach every path leaves
that distribution as it is if its transition densities are right: single perturbations, for hundreds
of steps with nothing else beside them, show a wrong one best.

Reference: bidirectional path tracing. Welch's t-tests between independent seeds: per pixel, per
block of 4 × 4 pixels and of the mean, each at the significance 10⁻³. Differences of some four times
the resolution that is asked of the mean and of the median block would be seen. A chain whose
mutations do not apply stays where it started, one lump in one pixel, which t-tests cannot judge:
single mutations are tried where they apply to (almost) all light.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from support import scenes, transport_scenes
from support.rendering import build, pictures
from support.statistics import agreement

DEPTH = 6
MUTATIONS = (
    "new_path",
    "bidirectional",
    "lens",
    "caustic",
    "multi_chain",
    "lens_subpath",
    "glossy_lens",
    "glossy_caustic",
    "aimed",
)
REACH_ALL = {"new_path", "bidirectional"}

SETS = [set(c) for n in range(1, len(MUTATIONS) + 1) for c in combinations(MUTATIONS, n)]
ADMISSIBLE = [c for c in SETS if c & REACH_ALL]
GLOSSY = {"glossy_lens", "glossy_caustic"}
WITH_NEAR_SPECULAR = {"dome_and_glossy"}


def label(mutations: set[str]) -> str:
    return "+".join(m for m in MUTATIONS if m in mutations)


def scene_of(name: str):
    return (transport_scenes if name in transport_scenes.TRANSPORT_SCENES else scenes).build(name)


@cache
def built(name: str):
    return build(scene_of(name))


@cache
def reference(name: str, seeds: int = 16, samples: int = 64, filter: str = "box") -> np.ndarray:
    settings = {"samples": samples, "depth": DEPTH, "filter": filter}
    return pictures(built(name), "bdpt", range(1000, 1000 + seeds), **settings)


def chains(
    name: str,
    mutations: set[str],
    seeds: int | Iterable[int] = 16,
    samples: int = 192,
    **settings: object,
) -> np.ndarray:
    """Everything is left to the chains, unless the settings say otherwise."""
    weights = dict.fromkeys(mutations, 1.0)
    return pictures(
        built(name),
        "mlt",
        seeds,
        samples=samples,
        depth=DEPTH,
        mutation_weights=weights,
        **{"selective": False, **settings},
    )


def test_the_sets() -> None:
    assert len(ADMISSIBLE) == 384


ALONE = {
    "new_path": "indirect_room",
    "bidirectional": "indirect_room",
    "lens": "seen_in_a_mirror",
    "caustic": "mirror_caustic_through_a_lens",
    "multi_chain": "pool",
    "lens_subpath": "suns_through_glass",
    "glossy_lens": "dome_and_glossy",
    "glossy_caustic": "dome_and_glossy",
    "aimed": "pool",
}


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_each_mutation_alone(mutation: str) -> None:
    name = ALONE[mutation]
    # Lens subpaths seldom move a chain that has nothing else: lumps of single pixels.
    questions = ("blocks", "mean") if mutation == "lens_subpath" else ("pixels", "blocks", "mean")
    agreement(chains(name, {mutation}), reference(name), lumpy=True).require(
        resolution=0.02, block_resolution=0.08, questions=questions
    )


CAMERAS_AND_LIGHTS = {
    "indirect_room": "a lamp with an area; pinhole",
    "glowing_mesh_and_mirrors": "emissive mesh; thin lens",
    "suns_through_glass": "suns with and without extent; orthographic",
    "core_in_a_glass_shell": "textured dome through glass",
}


@pytest.mark.parametrize("name", CAMERAS_AND_LIGHTS)
def test_all_mutations_together(name: str) -> None:
    got = chains(name, set(MUTATIONS))
    agreement(got, reference(name), lumpy=True).require(resolution=0.02, block_resolution=0.08)


@pytest.mark.parametrize("selective", [False, True], ids=["all by chains", "split"])
@pytest.mark.parametrize(
    ("two_stage", "direct"), [(True, True), (True, False), (False, False)],
    ids=["two stages", "two stages, direct light as all", "direct light as all"],
)  # fmt: skip
def test_stages_direct_light_and_split(two_stage: bool, direct: bool, selective: bool) -> None:
    """What is traced apart must be what chains leave out; the importance map must cancel; both
    parts of a split must be of the same paths, in the filter's margin too."""
    name = "suns_through_glass"
    got = chains(
        name,
        set(MUTATIONS),
        direct="separate" if direct else "mlt",
        two_stage=two_stage,
        selective=selective,
        filter="gaussian",
    )
    other = reference(name, filter="gaussian")
    agreement(got, other, lumpy=True).require(resolution=0.02, block_resolution=0.08)


# ---------------------------------------------------------------------------------------------
# All sets, and with more mutations


@cache
def sharp(name: str) -> np.ndarray:
    return reference(name, 24, 512)


@pytest.mark.slow
@pytest.mark.parametrize("name", transport_scenes.TRANSPORT_SCENES)
def test_every_admissible_set(name: str) -> None:
    """Direct light and stages alternate between the sets. Šidák's correction counts the sets. With
    so few mutations the light of a pixel is skewed, and differs by more than t-tests take for noise
    even if it is right: pixels are judged in the average over all sets, whose seeds all differ."""
    answers, pooled = {}, 0.0
    tried = [c for c in ADMISSIBLE if name in WITH_NEAR_SPECULAR or not c & GLOSSY]
    for i, mutations in enumerate(tried):
        variant = {"direct": ("separate", "mlt")[i % 2], "two_stage": i // 2 % 2 == 0}
        seeds = range(16 * i, 16 * i + 16)
        got = chains(name, mutations, seeds, samples=128, **variant)
        pooled = pooled + got / len(tried)
        answers[label(mutations)] = agreement(got, sharp(name), lumpy=True)
        print(f"{name:30} {label(mutations):60} {answers[label(mutations)]}")
    significance = -np.expm1(np.log1p(-1e-3) / len(answers))
    for answer in answers.values():
        answer.require(significance, resolution=0.1, questions=("blocks", "mean"))
    together = agreement(pooled, sharp(name), lumpy=True)
    print(f"{name:30} {'all':60} {together}")
    together.require(resolution=0.006, block_resolution=0.015)


@pytest.mark.slow
@pytest.mark.parametrize("mutation", MUTATIONS)
def test_each_mutation_alone_for_longer(mutation: str) -> None:
    name = ALONE[mutation]
    got = agreement(chains(name, {mutation}, seeds=24, samples=2048), sharp(name), lumpy=True)
    print(f"{name:30} {mutation:60} {got}")
    got.require(resolution=0.005, block_resolution=0.02, questions=("blocks", "mean"))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*transport_scenes.TRANSPORT_SCENES, *scenes.SCENES])
def test_every_scene(name: str) -> None:
    got = agreement(chains(name, set(MUTATIONS), seeds=24, samples=1024), sharp(name), lumpy=True)
    print(f"{name:30} {'default':60} {got}")
    got.require(resolution=0.008, block_resolution=0.025)
