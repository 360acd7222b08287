"""The tutorial of docs/checks.md, followed to the letter."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import usdmlt

ROOT = Path(__file__).parents[2]


def test_the_tutorial_works_from_an_empty_folder(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "checks.md").read_text()
    text = text[text.index("## From an empty folder") : text.index("## The fixtures")]
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    commands = re.findall(r"^    (pytest.*)$", text, re.MULTILINE)
    assert commands == ["pytest --usdmlt-update", "pytest"]
    (tmp_path / "test_pictures.py").write_text(code)
    # Where the package is used in place, nothing has told pytest of the plugin.
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["usdmlt.testing.plugin"]\n')
    stage = (ROOT / "scenes" / "cornell_box.usda").read_text()
    (tmp_path / "room.usda").write_text(stage)
    environment = os.environ | {
        "PYTHONPATH": str(Path(usdmlt.__file__).parents[1]),
        "PYTEST_ADDOPTS": "-o usdmlt_samples=24",  # a third of the ordinary number
    }

    def run(*command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", *command],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
        )

    for command in commands:
        done = run(*command.split())
        assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "references" / "room.exr").exists()
    changed = re.sub(
        r"(float inputs:intensity = )([\d.]+)", lambda m: f"{m[1]}{float(m[2]) * 1.05}", stage
    )
    assert changed != stage
    (tmp_path / "room.usda").write_text(changed)
    done = run("pytest", "--usdmlt-report", "out")
    assert done.returncode == 1
    assert "brightness" in done.stdout and "accept: pytest" in done.stdout
    assert (tmp_path / "out" / "index.html").exists()
