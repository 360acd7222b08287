"""Fixtures: the command line in a process of its own, and a small stage to render."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = 1
    endTimeCode = 3
)

def Xform "World"
{
    def Camera "main_cam"
    {
        float focalLength = 50
        float horizontalAperture = 50
        float verticalAperture = 25
        double3 xformOp:translate = (0, 0, 4)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Mesh "Panel" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [(0.8, 0.4, 0.2)]
    }

    def RectLight "Light"
    {
        float inputs:intensity = 3
        float inputs:width = 2
        float inputs:height = 2
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """A panel that a light behind the camera shines on; frames 1 to 3."""
    path = tmp_path / "panel.usda"
    path.write_text(STAGE)
    return path


@pytest.fixture
def usdmlt_command(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `usdmlt` with these arguments in ``tmp_path``."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "usdmlt", *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)

    return run


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Python's own handler of SIGINT, which is ignored in processes of the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
