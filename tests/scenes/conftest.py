"""Fixtures: the scenes that ship, as they are and with changes in the session layer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pxr import Usd

from support import eased
from support.eased import FOLDER

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
    """Open a scene by name, with changes."""
    return eased.open_scene
