"""Instances cost no geometry, and many meshes cost no more than their triangles.

`tests/benchmarks/large_scenes.py` prints the full sizes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
MEBIBYTE = 2**20


def measure(expression: str) -> dict[str, float]:
    """In a process of its own, so that its peak of memory is its own too."""
    code = (
        f"import json, sys; sys.path.insert(0, {str(BENCHMARKS)!r}); import large_scenes as l; "
        f"print(json.dumps(l.measure(lambda: l.{expression})))"
    )
    output = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=300
    ).stdout
    return json.loads(output)


def test_a_thousand_instances_need_hardly_more_memory_than_one() -> None:
    one = measure("instanced(200_000, 1)")
    thousand = measure("instanced(200_000, 1000)")
    assert thousand["peak memory"] - one["peak memory"] < 32 * MEBIBYTE
    # Of 200 million placed triangles.
    assert thousand["peak memory"] < 250 * MEBIBYTE
    assert thousand["build"] < 10


def test_a_thousand_meshes_build_in_seconds() -> None:
    got = measure("separate(1000, 200)")
    assert got["build"] < 5
    assert got["peak memory"] < 250 * MEBIBYTE


@pytest.mark.slow
@pytest.mark.parametrize("expression", ["instanced(1_000_000, 1000)", "separate(5000, 800)"])
def test_large_scenes_start_within_seconds(expression: str) -> None:
    got = measure(expression)
    assert got["build"] < 15
    assert got["first sample"] < 15
    assert got["peak memory"] < 3000 * MEBIBYTE
