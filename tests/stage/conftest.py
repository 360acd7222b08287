"""Fixtures: stages written as text, and read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from support.usda import QUAD
from usdmlt.scene import Mesh, Scene
from usdmlt.stage import Inspection, inspect, load


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write the body of a stage; ``metadata`` goes between the parentheses at its top."""

    def write_stage(body: str, metadata: str = "", name: str = "stage.usda") -> Path:
        path = tmp_path / name
        body = body.replace("QUAD", QUAD).replace("}", "\n}\n")  # usda wants lines ended there
        path.write_text(f"#usda 1.0\n(\n{metadata}\n)\n{body}\n")
        return path

    return write_stage


@pytest.fixture
def read(write: Callable[..., Path]) -> Callable[..., Scene]:
    """Write the body of a stage and load it."""

    def read_stage(body: str, metadata: str = "", **options: object) -> Scene:
        return load(write(body, metadata), **options)

    return read_stage


@pytest.fixture
def examine(write: Callable[..., Path]) -> Callable[..., Inspection]:
    """Write the body of a stage and inspect it."""

    def examine_stage(body: str, metadata: str = "", **options: object) -> Inspection:
        return inspect(write(body, metadata), **options)

    return examine_stage


@pytest.fixture
def only_mesh(read: Callable[..., Scene]) -> Callable[..., Mesh]:
    """The one mesh of a stage with the given body."""

    def read_mesh(body: str, metadata: str = "", **options: object) -> Mesh:
        scene = read(body, metadata, **options)
        assert len(scene.meshes) == 1
        return scene.meshes[0]

    return read_mesh
