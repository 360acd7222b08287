"""`usdmlt inspect`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def test_what_would_be_rendered_is_listed(usdmlt_command: Run, stage: Path) -> None:
    done = usdmlt_command("inspect", stage, "-w", 64)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"{stage}" in done.stdout
    assert "camera     /World/main_cam" in done.stdout
    assert "picture    64x32" in done.stdout
    assert "1 meshes, 2 triangles" in done.stdout
    assert "1 RectLight" in done.stdout
    assert "warnings   none" in done.stdout


def test_prims_are_a_table_of_what_becomes_of_them(usdmlt_command: Run, tmp_path: Path) -> None:
    (tmp_path / "s.usda").write_text("""#usda 1.0
def Xform "a" {
    def Cube "c" {}
    def Cube "d" {}
    def FluffyCloud "v" {}
    def Camera "main_cam" {}
    def "untyped" {}
}
def RenderSettings "s" {
    int2 resolution = (16, 8)
    float4 dataWindowNDC = (0.5, 0, 1, 1)
    int usdmlt:depth = 5
    rel products = </p>
}
def RenderProduct "p" {}
""")
    done = usdmlt_command("inspect", "s.usda")
    assert done.returncode == 0, done.stderr
    table = {tuple(line.removeprefix("prims").split()) for line in done.stdout.splitlines()}
    for row in (
        ("Cube", "2", "geometry"),
        ("FluffyCloud", "1", "not", "rendered"),
        ("Camera", "1", "camera"),
        ("Xform", "1", "grouping"),
        ("(no", "type)", "1", "grouping"),
        ("RenderSettings", "1", "render", "settings"),
    ):
        assert row in table, done.stdout
    assert "settings   /s, depth 5\n           product /p: p.exr\n" in done.stdout
    assert "picture    8x8 from (8, 0) of 16x8" in done.stdout
    assert "warning    FluffyCloud prims are not rendered\n           /a/v\n" in done.stdout


def test_json_has_all_of_it(usdmlt_command: Run, stage: Path) -> None:
    done = usdmlt_command("inspect", stage, "--json")
    content = json.loads(done.stdout)
    assert content["camera"] == "/World/main_cam"
    assert content["triangles"] == 2
    assert {"type": "Mesh", "count": 1, "fate": "geometry"} in content["prims"]
    assert content["lights"] == [["RectLight", "/World/Light"]]
    assert content["warnings"] == []


def test_what_would_not_be_is_named_by_prim_and_all_of_it_on_request(
    usdmlt_command: Run, tmp_path: Path
) -> None:
    patches = "\n".join(f'def NurbsPatch "Patch{i}" {{ }}' for i in range(9))
    (tmp_path / "patches.usda").write_text(f"#usda 1.0\n{patches}\n")
    brief = usdmlt_command("inspect", "patches.usda")
    assert brief.returncode == 0, brief.stderr
    assert "warning " in brief.stdout
    assert "/Patch0" in brief.stdout
    assert "/Patch8" not in brief.stdout
    assert "/Patch8" in usdmlt_command("inspect", "patches.usda", "-v").stdout


@pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_leaves_early_is_no_error(stage: Path, unbuffered: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "usdmlt", "inspect", str(stage)]
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, env=environment)
    os.close(writer)
    assert done.stderr == b""
