"""BasisCurves, HermiteCurves and NurbsCurves as tubes, or, with normals, as ribbons."""

from __future__ import annotations

import math

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Error, Report
from usdmlt.scene import Mesh, Primvar
from usdmlt.stage.curve_samples import (
    CurveSamples,
    sample_curves,
    sample_hermite,
    sample_nurbs,
    segment_counts,
)
from usdmlt.stage.detail import Detail
from usdmlt.stage.primvars import as_floats
from usdmlt.stage.sampled import Sampled, one_each
from usdmlt.stage.tubes import directions, mitred, ribbons, tubes

CHORD = 4.0  # pixels between samples along a curve
STEPS = (1, 16)  # samples per segment, least and most
SIDES = (3, 24)  # of a tube: 3 for hairs of a pixel
DEFAULT_WIDTH = 1.0  # where no widths are authored, as in Storm

Read = tuple[Mesh, Sampled]


def read_curves(prim: Usd.Prim, time: Usd.TimeCode, detail: Detail, report: Report) -> Read | None:
    """The mesh of all curves of a prim; None, with a warning, if nothing is left to see."""
    curves, path = UsdGeom.Curves(prim), prim.GetPath()
    points = read_points(curves, time)
    counts = np.asarray(curves.GetCurveVertexCountsAttr().Get(time) or [], dtype=np.int64)
    if points is None or not len(points) or not len(counts):
        report.note("curves without points", path)
        return None
    if counts.min() < 0 or counts.sum() != len(points):
        raise Error(
            f"{path}: curveVertexCounts add up to {counts.sum()}, "
            f"but there are {len(points)} points"
        )
    sampled = _sample(prim, points, counts, time, detail, report)
    if sampled is None or not len(sampled[0].curve):
        report.note("curves without segments", path)
        return None
    samples, at, tangents = sampled
    radii = _radii(curves, samples, len(counts), time, report)
    return _surround(curves, samples, at, tangents, radii, len(counts), time, detail, report)


def read_points(
    prim: UsdGeom.PointBased, time: Usd.TimeCode, frame: Usd.TimeCode | None = None
) -> np.ndarray | None:
    """(n, 3) float32 points, checked; None if there are none. With a ``frame``, they are where
    velocities take them from there."""
    value = prim.GetPointsAttr().Get(time)
    if frame is not None and value is not None:
        value = prim.ComputePointsAtTime(time, frame)
    points = None if value is None else as_floats(value)
    if points is None or points.shape[1] != 3:
        return None
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise Error(f"{prim.GetPath()}: point {bad} is not finite: {points[bad].tolist()}")
    return points


def _sample(
    prim: Usd.Prim,
    points: np.ndarray,
    counts: np.ndarray,
    time: Usd.TimeCode,
    detail: Detail,
    report: Report,
) -> tuple[CurveSamples, np.ndarray, np.ndarray] | None:
    """Samples, their points and their tangents."""
    steps = _steps(points, counts, detail)
    if prim.IsA(UsdGeom.HermiteCurves):
        value = UsdGeom.HermiteCurves(prim).GetTangentsAttr().Get(time)
        slopes = None if value is None else as_floats(value)
        if slopes is None or slopes.shape != points.shape:
            report.warn("Hermite curves whose tangents do not fit are straight", prim.GetPath())
            slopes = None
        if slopes is not None:
            samples = sample_hermite(counts, steps)
            return _at(samples, np.concatenate([points, slopes]))
        return _polyline(sample_curves(counts, "linear", "nonperiodic", 1), points)
    if prim.IsA(UsdGeom.NurbsCurves):
        return _sample_nurbs(UsdGeom.NurbsCurves(prim), points, counts, time, steps)
    curves = UsdGeom.BasisCurves(prim)
    kind = str(curves.GetTypeAttr().Get(time))
    if kind != "linear":
        kind = str(curves.GetBasisAttr().Get(time))
    if kind not in ("linear", "bezier", "bspline", "catmullRom"):
        report.warn(f"curves of basis {kind} are drawn as polylines", prim.GetPath())
        kind = "linear"
    wrap = str(curves.GetWrapAttr().Get(time))
    if (segment_counts(counts, kind, wrap) == 0).any():
        report.note("curves of too few points are left out", prim.GetPath())
    samples = sample_curves(counts, kind, wrap, steps)
    return _polyline(samples, points) if kind == "linear" else _at(samples, points)


def _sample_nurbs(
    curves: UsdGeom.NurbsCurves,
    points: np.ndarray,
    counts: np.ndarray,
    time: Usd.TimeCode,
    steps: int,
) -> tuple[CurveSamples, np.ndarray, np.ndarray]:
    path = curves.GetPath()
    orders = np.asarray(curves.GetOrderAttr().Get(time) or [], dtype=np.int64)
    knots = np.asarray(curves.GetKnotsAttr().Get(time) or [], dtype=np.float64)
    ranges = np.asarray(curves.GetRangesAttr().Get(time) or [], dtype=np.float64).reshape(-1, 2)
    if len(orders) != len(counts) or (orders < 1).any() or (counts < orders).any():
        raise Error(f"{path}: order does not fit the curves")
    if len(knots) != (counts + orders).sum():
        raise Error(f"{path}: {len(knots)} knots, where {(counts + orders).sum()} are needed")
    ends = np.cumsum(counts + orders)
    for start, end in zip(ends - counts - orders, ends, strict=True):
        check_knots(path, knots[start:end])
    starts = ends - counts - orders
    widest = np.stack([knots[starts + orders - 1], knots[starts + counts]], axis=1)
    if ranges.shape != widest.shape:
        ranges = widest
    ranges = np.clip(ranges, widest[:, :1], widest[:, 1:])
    weights = read_weights(curves, len(points), time)
    return _at(sample_nurbs(counts, orders, knots, ranges, weights, steps), points)


def check_knots(path: object, knots: np.ndarray) -> None:
    """:class:`Error` for knots that fall or are not finite."""
    if not np.isfinite(knots).all() or (np.diff(knots) < 0).any():
        raise Error(f"{path}: knots must be finite and must not fall")


def read_weights(
    prim: UsdGeom.NurbsCurves | UsdGeom.NurbsPatch, count: int, time: Usd.TimeCode
) -> np.ndarray | None:
    """The weights of control points; None if there are none."""
    value = prim.GetPointWeightsAttr().Get(time)
    if not value:
        return None
    weights = np.asarray(value, dtype=np.float64)
    if len(weights) != count or not (np.isfinite(weights) & (weights > 0)).all():
        raise Error(f"{prim.GetPath()}: pointWeights must be {count} positive numbers")
    return weights


def _at(samples: CurveSamples, control: np.ndarray) -> tuple[CurveSamples, np.ndarray, np.ndarray]:
    at, slopes = samples.points(control), samples.slopes(control)
    if not len(at):
        return samples, at, slopes
    return samples, at, directions(at, slopes, samples.curve, samples.closed)


def _polyline(samples: CurveSamples, control: np.ndarray):
    at = samples.points(control)
    if not len(at):
        return samples, at, at
    return samples, at, mitred(at, samples.curve, samples.closed)


def _steps(points: np.ndarray, counts: np.ndarray, detail: Detail) -> int:
    """Samples per segment: so that neighbours are a few pixels apart."""
    if detail.fixed is not None:
        return 2 ** (detail.fixed + 1)
    within = np.ones(len(points), dtype=bool)
    within[np.cumsum(counts[counts > 0]) - 1] = False  # from the end of a curve to the next one
    sides = np.diff(points.astype(np.float64), axis=0)[within[:-1]]
    if not len(sides):
        return STEPS[0]
    pixels = detail.pixels(points, float(np.sqrt(np.mean(np.square(sides).sum(axis=1)))))
    return int(np.clip(math.ceil(min(pixels, 1e6) / CHORD), *STEPS))


def _radii(
    curves: UsdGeom.Curves,
    samples: CurveSamples,
    count: int,
    time: Usd.TimeCode,
    report: Report,
) -> np.ndarray:
    """(samples,) half the widths."""
    primvar = UsdGeom.PrimvarsAPI(curves).GetPrimvar("widths")
    if primvar and primvar.HasAuthoredValue():
        value, interpolation = primvar.ComputeFlattened(time), primvar.GetInterpolation()
    else:
        value, interpolation = curves.GetWidthsAttr().Get(time), curves.GetWidthsInterpolation()
    path = curves.GetPath()
    widths = np.asarray(value if value is not None else [], dtype=np.float64)
    weights = {
        UsdGeom.Tokens.constant: one_each(np.zeros_like(samples.curve), 1),
        UsdGeom.Tokens.uniform: one_each(samples.curve, count),
        UsdGeom.Tokens.vertex: samples.vertex,
    }.get(interpolation, samples.varying)
    if len(widths) == 1 and weights.count != 1:  # common in files, and what is meant is clear
        weights = one_each(np.zeros_like(samples.curve), 1)
    if not len(widths):
        report.note(f"curves without widths are {DEFAULT_WIDTH:g} wide", path)
        widths, weights = np.array([DEFAULT_WIDTH]), one_each(np.zeros_like(samples.curve), 1)
    elif len(widths) != weights.count:
        report.warn("widths whose number does not fit: the first is used", path)
        weights = one_each(np.zeros_like(samples.curve), len(widths))
    if not np.isfinite(widths).all():
        raise Error(f"{path}: widths are not all finite")
    return np.maximum(weights(widths[:, None])[:, 0], 0.0) / 2


def _surround(
    curves: UsdGeom.Curves,
    samples: CurveSamples,
    at: np.ndarray,
    tangents: np.ndarray,
    radii: np.ndarray,
    count: int,
    time: Usd.TimeCode,
    detail: Detail,
    report: Report,
) -> Read | None:
    facing = _normals(curves, samples, count, time, report)
    if facing is not None:
        sides = 2
        points, normals, triangles = ribbons(
            at, tangents, radii, facing, samples.curve, samples.closed
        )
    else:
        sides = _sides(at, radii, detail)
        points, normals, triangles = tubes(
            at, tangents, radii, samples.curve, samples.counts, sides, samples.closed
        )
    curve = np.repeat(samples.curve, sides)
    solid = (radii[triangles // sides] > 0).any(axis=1)
    triangles = triangles[solid]
    if not len(triangles):
        report.note("shapes without extent are left out", curves.GetPath())
        return None
    mesh = Mesh(
        points.astype(np.float32),
        triangles,
        Primvar(normals.astype(np.float32)),
        name=str(curves.GetPath()),
    )
    surface = Sampled(
        triangles,
        curve[triangles[:, 0]],
        count,
        samples.vertex.repeated(sides),
        samples.varying.repeated(sides),
    )
    return mesh, surface


def _sides(at: np.ndarray, radii: np.ndarray, detail: Detail) -> int:
    """Of a tube: fewer where it is thin, so that it is off by 1/8 pixel at most."""
    if detail.fixed is not None:
        return 6 * 2**detail.fixed
    pixels = min(detail.pixels(at, float(radii.max())), 1e6)
    if pixels <= 0.5:
        return SIDES[0]
    return int(np.clip(math.ceil(math.pi / math.acos(1 - min(0.125 / pixels, 0.5))), 5, SIDES[1]))


def _normals(
    curves: UsdGeom.Curves,
    samples: CurveSamples,
    count: int,
    time: Usd.TimeCode,
    report: Report,
) -> np.ndarray | None:
    """(samples, 3) the normals of ribbons; None for tubes."""
    primvar = UsdGeom.PrimvarsAPI(curves).GetPrimvar("normals")
    if primvar and primvar.HasAuthoredValue():
        value, interpolation = primvar.ComputeFlattened(time), primvar.GetInterpolation()
    else:
        value, interpolation = curves.GetNormalsAttr().Get(time), curves.GetNormalsInterpolation()
    if not value:
        return None
    normals = np.asarray(value, dtype=np.float64)
    weights = {
        UsdGeom.Tokens.constant: one_each(np.zeros_like(samples.curve), 1),
        UsdGeom.Tokens.uniform: one_each(samples.curve, count),
        UsdGeom.Tokens.vertex: samples.vertex,
    }.get(interpolation, samples.varying)
    if normals.shape != (weights.count, 3) or not np.isfinite(normals).all():
        report.warn("ribbons whose normals do not fit are tubes", curves.GetPath())
        return None
    return weights(normals)
