"""Fixtures: the scenes that ship, as they are and with changes in the session layer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom

FOLDER = Path(__file__).parents[2] / "scenes"
SCENES = sorted(path.stem for path in FOLDER.glob("*.usda"))


@pytest.fixture
def folder() -> Path:
    """Where the scenes are."""
    return FOLDER


@pytest.fixture(params=SCENES)
def scene_path(request: pytest.FixtureRequest) -> Path:
    """The file of each scene in turn."""
    return FOLDER / f"{request.param}.usda"


@pytest.fixture
def open_scene() -> Callable[..., Usd.Stage]:
    """Open a scene by name.

    ``changes``: values of attributes by their path; False by a prim's path leaves the prim out.
    ``boxes``: (centre, size) of boxes to add.
    """

    def open_scene(name: str, changes: dict | None = None, boxes: tuple = ()) -> Usd.Stage:
        stage = Usd.Stage.Open(str(FOLDER / f"{name}.usda"))
        stage.SetEditTarget(stage.GetSessionLayer())
        for key, value in (changes or {}).items():
            path = Sdf.Path(key)
            if path.IsPropertyPath():
                attribute = stage.GetAttributeAtPath(path)
                assert attribute, f"{name} has no {path}"
                attribute.Set(value)
            else:
                assert stage.GetPrimAtPath(path), f"{name} has no {path}"
                stage.GetPrimAtPath(path).SetActive(value)
        for number, (centre, size) in enumerate(boxes):
            box = UsdGeom.Cube.Define(stage, f"/World/Box{number}")
            box.CreateSizeAttr(1.0)
            box.AddTranslateOp().Set(centre)
            box.AddScaleOp().Set(size)
        return stage

    return open_scene
