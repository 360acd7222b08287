"""What a scene that ships has: documentation, units, a camera, a size, nothing to warn about."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
from pxr import Usd, UsdGeom, UsdRender

from usdmlt.stage import load

# The scenes that documentation and benchmarks name.
NAMED = {"cornell_box", "caustics", "door_ajar", "pool"}


def test_the_scenes_that_are_named_elsewhere_are_there(folder: Path) -> None:
    names = {path.stem for path in folder.glob("*.usda")}
    assert names >= NAMED
    assert len(names) >= 5


def test_a_scene_says_what_it_shows(scene_path: Path) -> None:
    stage = Usd.Stage.Open(str(scene_path))
    title = stage.GetRootLayer().documentation.splitlines()[0]
    assert 20 < len(title) < 120
    assert scene_path.name in (scene_path.parent / "README.md").read_text()


def test_a_scene_has_units_a_camera_and_thumbnail_size_settings(scene_path: Path) -> None:
    stage = Usd.Stage.Open(str(scene_path))
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert stage.HasAuthoredMetadata("upAxis")
    assert UsdGeom.StageHasAuthoredMetersPerUnit(stage)

    settings = UsdRender.Settings.GetStageRenderSettings(stage)
    assert settings, "renderSettingsPrimPath"
    width, height = settings.GetResolutionAttr().Get()
    assert width * height <= 256 * 256
    (path,) = settings.GetCameraRel().GetTargets()
    assert path.name == "main_cam"
    camera = UsdGeom.Camera(stage.GetPrimAtPath(path)).GetCamera(Usd.TimeCode.Default())
    assert camera.aspectRatio == pytest.approx(width / height, rel=1e-3)


def test_a_scene_is_read_without_a_warning(
    scene_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        scene = load(scene_path, strict=True)
    assert not caplog.records
    assert scene.meshes
    assert scene.camera.name == "/World/main_cam"


def test_authored_extents_are_those_of_the_geometry(scene_path: Path) -> None:
    """Viewers frame and cull by them."""
    stage = Usd.Stage.Open(str(scene_path))
    checked = 0
    for prim in stage.Traverse():
        boundable = UsdGeom.Boundable(prim)
        if not prim.IsA(UsdGeom.Gprim):
            continue
        authored = boundable.GetExtentAttr().Get()
        computed = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode.Default())
        if prim.IsA(UsdGeom.Capsule_1) and Usd.GetVersion() < (0, 26, 11):
            continue  # computed there as if both ends had the greater radius
        for a, b in zip(authored, computed, strict=True):
            assert a == pytest.approx(b, abs=2e-3 * max(map(abs, b))), prim.GetPath()
        checked += 1
    assert checked >= 4


def test_files_are_small(folder: Path) -> None:
    sizes = {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}
    assert max(sizes.values()) < 200_000
    assert sum(sizes.values()) < 500_000
