"""Large stages are read within seconds; the times are printed (pytest -m slow -s)."""

from __future__ import annotations

import time

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

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


def timed_load(stage: Usd.Stage, what: str, seconds: float = CPU_SECONDS, **options: object):
    limit = seconds
    started = time.process_time()
    scene = load(stage, **options)
    seconds = time.process_time() - started
    print(f"{what}: read in {seconds:.1f} CPU seconds")
    assert seconds < limit
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


def test_a_hundred_thousand_prims():
    """A third each of cubes, squares and transforms."""
    layer = Sdf.Layer.CreateAnonymous()
    corners = Vt.Vec3fArray([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    values = (
        ("points", Sdf.ValueTypeNames.Point3fArray, corners),
        ("faceVertexCounts", Sdf.ValueTypeNames.IntArray, Vt.IntArray([4])),
        ("faceVertexIndices", Sdf.ValueTypeNames.IntArray, Vt.IntArray([0, 1, 2, 3])),
        ("subdivisionScheme", Sdf.ValueTypeNames.Token, "none"),
    )
    with Sdf.ChangeBlock():
        for i in range(99_999):
            kind = ("Cube", "Mesh", "Xform")[i % 3]
            prim = Sdf.CreatePrimInLayer(layer, f"/World/group{i // 100}/p{i}")
            prim.specifier, prim.typeName = Sdf.SpecifierDef, kind
            for name, value_type, value in values if kind == "Mesh" else ():
                Sdf.AttributeSpec(prim, name, value_type).default = value
        for prim in (layer.GetPrimAtPath("/World"), *layer.GetPrimAtPath("/World").nameChildren):
            prim.specifier = Sdf.SpecifierDef
    scene = timed_load(Usd.Stage.Open(layer), "99 999 prims", seconds=60)
    assert len(scene.meshes) == 66_666


def test_a_subdivision_surface_of_ninety_thousand_faces():
    stage = Usd.Stage.CreateInMemory()
    define_grid(stage, "/m", 300)
    UsdGeom.Mesh(stage.GetPrimAtPath("/m")).GetSubdivisionSchemeAttr().Set("catmullClark")
    scene = timed_load(stage, "a subdivision surface of 720 000 triangles", complexity="medium")
    assert len(scene.meshes[0].triangles) == 8 * 300 * 300


def test_a_million_points():
    stage = Usd.Stage.CreateInMemory()
    points = UsdGeom.Points.Define(stage, "/p")
    places = np.random.default_rng(1).random((1_000_000, 3), dtype=np.float32)
    points.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(places))
    points.CreateWidthsAttr([0.001])
    points.SetWidthsInterpolation("constant")
    scene = timed_load(stage, "1 000 000 points")
    assert len(scene.instances[0].transforms) == 1_000_000


def test_a_hundred_thousand_curves():
    stage = Usd.Stage.CreateInMemory()
    rng = np.random.default_rng(1)
    steps = np.cumsum(rng.normal(size=(100_000, 8, 3)) * 0.02, axis=1)
    places = (10 * rng.random((100_000, 1, 3)) + steps).reshape(-1, 3).astype(np.float32)
    curves = UsdGeom.BasisCurves.Define(stage, "/c")
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(places))
    curves.CreateCurveVertexCountsAttr(Vt.IntArray(100_000, 8))
    curves.CreateBasisAttr("bspline")
    curves.CreateWrapAttr("pinned")
    curves.CreateWidthsAttr([0.005])
    curves.SetWidthsInterpolation("constant")
    scene = timed_load(stage, "100 000 curves of 7 segments", seconds=30)
    mesh = scene.meshes[0]
    size = mesh.points.nbytes + mesh.triangles.nbytes + mesh.normals.values.nbytes
    print(f"{size / 700_000:.0f} bytes per segment")
    assert len(mesh.triangles) == 700_000 * 6
