"""What tells renders apart whose units must not be summed."""

from __future__ import annotations

import copy
import subprocess
import sys

import numpy as np
import pytest

import usdmlt
from usdmlt import fingerprint


def of(stage, width: int = 64, **settings: object) -> fingerprint.Fingerprint:
    settings = {"integrator": "path"} | settings
    scene = usdmlt.load(stage, width=width)
    return usdmlt.Rendering(scene, usdmlt.Settings(**settings)).fingerprint


def test_how_much_is_rendered_and_on_how_many_threads_is_no_part_of_it(stage) -> None:
    first = of(stage, samples=4, threads=1)
    assert fingerprint.difference(of(stage, samples=8, threads=2, time=5.0), first) is None


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"seed": 7}, "its seed is 7, not 0"),
        ({"depth": 3}, "its depth is 3, not 16"),
        ({"integrator": "bdpt"}, "its integrator is bdpt, not path"),
        ({"filter": "box"}, "its filter is box, not gaussian"),
        ({"error": False}, "its error is False, not True"),
        ({"aovs": "direct"}, "it has other layers"),
        ({"width": 65}, "it is of another scene, size or frame"),
        ({"embree_isa": "sse4.2"}, r"it is of Embree .*sse4.2.*, not .*avx2"),
    ],
)
def test_what_differs_is_named(stage, changed, said) -> None:
    import re

    assert re.match(said, fingerprint.difference(of(stage, **changed), of(stage)) or "")


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("version", "it is of usdmlt other, not "),
        ("instruction_set", "it is of a build for other, not "),
        ("plan", "its pilots measured something else"),
    ],
)
def test_other_versions_and_machines_are_told(stage, key, said) -> None:
    ours = of(stage)
    assert (fingerprint.difference(ours | {key: "other"}, ours) or "").startswith(said)


def test_every_change_of_a_scene_is_another_scene(stage) -> None:
    scene = usdmlt.load(stage, width=64)
    digest = fingerprint.scene_digest(scene)
    assert fingerprint.scene_digest(copy.deepcopy(scene)) == digest
    moved, lit, tinted = (copy.deepcopy(scene) for _ in range(3))
    moved.meshes[0].points = moved.meshes[0].points + np.float32(1e-6)
    lit.lights[0].radiance = tuple(1.0000001 * x for x in lit.lights[0].radiance)
    tinted.materials[0].name += "x"
    others = {fingerprint.scene_digest(other) for other in (moved, lit, tinted)}
    assert len(others | {digest}) == 4


def test_other_processes_and_copies_of_the_stage_have_the_same(stage, tmp_path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "copy.usda").write_text(stage.read_text())
    code = (
        "import sys, usdmlt; from usdmlt.fingerprint import scene_digest\n"
        "print(scene_digest(usdmlt.load(sys.argv[1], width=64)))"
    )
    command = [sys.executable, "-c", code, str(elsewhere / "copy.usda")]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert said == fingerprint.scene_digest(usdmlt.load(stage, width=64))


def test_values_of_different_kinds_do_not_collide() -> None:
    import hashlib

    def digest(value: object) -> str:
        made = hashlib.sha256()
        fingerprint._update(made, value)
        return made.hexdigest()

    values = [1, 1.0, True, "1", None, [1], [[1]], {"1": 1}, "", [], ["", ""], ["", "", ""]]
    values += [np.float32([1]), np.float64([1]), np.float32([[1]]), frozenset({"1"})]
    assert len({digest(value) for value in values}) == len(values)
    assert digest(frozenset({"1"})) == digest(["1"])
