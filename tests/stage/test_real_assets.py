"""Stages made by others: all of them render, or say in one line why not; what of them is not
rendered is a checked list.

Set USDMLT_ASSETS to a folder with the USD working group's assets (usd-wg/) and the UsdLux
conformance scenes (luxtest/) to run these.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from support.rendering import rgba
from usdmlt.errors import Error, Report
from usdmlt.options import LoadOptions
from usdmlt.stage import load
from usdmlt.stage.loading import read_stage

FOLDER = Path(os.environ.get("USDMLT_ASSETS", "/nonexistent"))
FILES = sorted(path for path in FOLDER.rglob("*.usd*") if path.suffix != ".txt")

pytestmark = pytest.mark.skipif(not FILES, reason="USDMLT_ASSETS names no folder of assets")

# Broken on purpose, and what is broken.
REFUSED = {
    "framesPerSecond_-1.usda": "framesPerSecond",
    "framesPerSecond_0.usda": "framesPerSecond",
    "weird_matrix_transform.usda": "singular",
}

NO_LIGHTS = "the stage has no lights: a white dome lights it"  # said of most, and no fault
COMPOSITION = "USD could not compose all of the stage"
MISSING = "texture files are missing"
NO_POINTS = "meshes without points"
# What is warned of and of how many prims; of all other files nothing is. The first two kinds are
# broken references, most of them on purpose.
WARNINGS = {
    "payload_invalid.usda": {COMPOSITION: 1},
    "reference_invalid.usda": {COMPOSITION: 1},
    "reference_prim_in_other_file.usda": {COMPOSITION: 2},
    "reference_prim_in_same_file.usda": {COMPOSITION: 2},
    "sublayer_invalid.usda": {COMPOSITION: 1},
    "environment.usda": {MISSING: 1},
    "standard_shader_ball_scene.usda": {MISSING: 1},
    "basicTextured.usda": {MISSING: 1},
    "basicTextured_flatten.usda": {MISSING: 1},
    "shaderball.usda": {NO_POINTS: 1},
    "empty.usda": {NO_POINTS: 1},
    "pointsTypes.usda": {NO_POINTS: 8},
    "DrawModes.usd": {MISSING: 84},  # the pictures on its cards
    "subdiv_loop_quads.usda": {"Loop's scheme is for triangles: other faces are split": 1},
}

WIDTH = 24


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_stage_renders_and_warns_of_what_is_listed_or_says_why_not(path):
    if path.name in REFUSED:
        with pytest.raises(Error, match=REFUSED[path.name]) as raised:
            load(path)
        assert "\n" not in str(raised.value)
        return
    report = Report()
    scene = read_stage(report, path, LoadOptions(width=WIDTH)).scene
    picture = rgba(scene, "path", samples=1, depth=3)
    assert picture.shape == (scene.height, WIDTH, 4)
    assert np.isfinite(picture).all()
    found = {w.kind: len(w.paths) for w in report.warnings if w.kind != NO_LIGHTS}
    assert found == WARNINGS.get(path.name, {})


@pytest.mark.parametrize("integrator", ["bdpt", "mlt"])
@pytest.mark.parametrize("name", ["McUsd.usda", "Teapot.usd", "CesiumMan.usdz", "dome.usda"])
def test_every_integrator_renders_them(name, integrator):
    path = next((path for path in FILES if path.name == name), None)
    if path is None:
        pytest.skip(f"{name} is not there")
    scene = load(path, width=WIDTH)
    picture = rgba(scene, integrator, samples=4, depth=4)
    expected = rgba(scene, "path", samples=16, depth=4)
    assert picture[..., :3].mean() == pytest.approx(expected[..., :3].mean(), rel=0.3)
