"""Our pictures beside Mitsuba's of the same scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from support.rendering import build, pictures
from support.statistics import Agreement, agreement
from usdmlt import scene as s
from usdmlt.testing import mitsuba as other

DEPTH = 6


def compare(
    mi: Any,
    folder: Path,
    scene: s.Scene,
    seeds: int,
    samples: int,
    mutations: int,
    theirs: int,
    integrators: Iterable[str],
) -> Iterator[Agreement]:
    """By integrator: with so many samples per pixel, or mutations by chains, and of Mitsuba
    ``theirs``, which are not stratified."""
    loaded = other.load(mi, scene, folder, DEPTH, roulette_depth=1000)
    reference = other.pictures(mi, loaded, seeds, theirs)
    built = build(scene)
    for integrator in integrators:
        work = mutations if integrator == "mlt" else samples
        ours = pictures(built, integrator, seeds, samples=work, depth=DEPTH)
        got = agreement(ours, reference, lumpy=integrator == "mlt")
        print(f"{integrator:5} {got}")
        yield got
