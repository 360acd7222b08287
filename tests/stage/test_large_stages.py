"""Large stages are read within seconds; the times are printed (pytest -m slow -s)."""

from __future__ import annotations

import time

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from usdmlt.stage import load

pytestmark = pytest.mark.slow

CPU_SECONDS = 15  # several times what it takes, for slow machines


def define_grid(stage: Usd.Stage, path: str, cells: int) -> None:
    """A bumpy sheet of cells x cells quadrilaterals."""
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1))
    points = np.stack([x, y, 0.01 * np.sin(40 * x) * np.cos(30 * y)], axis=-1).reshape(-1, 3)
    corner = np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)
    quads = np.stack([corner, corner + 1, corner + cells + 2, corner + cells + 1], axis=-1)
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(cells * cells, 4))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.astype(np.int32).ravel()))
    mesh.CreateSubdivisionSchemeAttr("none")


def timed_load(stage: Usd.Stage, what: str):
    started = time.process_time()
    scene = load(stage)
    seconds = time.process_time() - started
    print(f"{what}: read in {seconds:.1f} CPU seconds")
    assert seconds < CPU_SECONDS
    return scene


def test_a_million_triangles_a_thousand_times():
    stage = Usd.Stage.CreateInMemory()
    stage.CreateClassPrim("/Sheet")
    define_grid(stage, "/Sheet/mesh", 708)
    for i in range(1000):
        instance = UsdGeom.Xform.Define(stage, f"/World/i{i}")
        instance.AddTranslateOp().Set((i, 0, 0))
        instance.GetPrim().GetReferences().AddInternalReference("/Sheet")
        instance.GetPrim().SetInstanceable(True)
    scene = timed_load(stage, "1 000 instances of 1 002 528 triangles")
    assert [len(p.meshes[0].triangles) for p in scene.prototypes] == [2 * 708 * 708]
    assert len(scene.instances[0].transforms) == 1000


def test_a_million_point_instances():
    stage = Usd.Stage.CreateInMemory()
    instancer = UsdGeom.PointInstancer.Define(stage, "/i")
    define_grid(stage, "/i/sheet", 10)
    instancer.CreatePrototypesRel().AddTarget("/i/sheet")
    positions = np.random.default_rng(1).random((1_000_000, 3), dtype=np.float32)
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
    instancer.CreateProtoIndicesAttr(Vt.IntArray(len(positions), 0))
    scene = timed_load(stage, "1 000 000 point instances")
    assert scene.instances[0].transforms[:, 3, :3] == pytest.approx(positions, abs=1e-6)


def test_five_thousand_meshes():
    stage = Usd.Stage.CreateInMemory()
    for i in range(5000):
        UsdGeom.Xform.Define(stage, f"/World/x{i}").AddTranslateOp().Set((i, 0, 0))
        define_grid(stage, f"/World/x{i}/mesh", 10)
    scene = timed_load(stage, "5 000 meshes of 200 triangles")
    assert len(scene.meshes) == 5000
