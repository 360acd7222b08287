"""Points along curves (cubic bases, Hermite, NURBS) as weights of their control points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdmlt.stage.nurbs import basis, rational, sample_parameters
from usdmlt.stage.sampled import Weights

# Rows: powers 1, u, u², u³; columns: the four control points.
BASES = {
    "bezier": np.array([[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]),
    "bspline": np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6,
    "catmullRom": np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2,
}
HERMITE = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]])  # p0 p1 m0 m1


@dataclass
class CurveSamples:
    """Samples of curves end to end. ``curve`` (n,): which one each is of, ``counts`` (curves,).

    ``points``, ``slopes``: weights of the control points; ``vertex``, ``varying``: of primvars.
    ``closed``: whether the last sample of a curve is followed by the first.
    """

    curve: np.ndarray
    counts: np.ndarray
    points: Weights
    slopes: Weights
    vertex: Weights
    varying: Weights
    closed: bool = False


def segment_counts(counts: np.ndarray, kind: str, wrap: str) -> np.ndarray:
    """(curves,) segments of curves of so many vertices (UsdGeomBasisCurves); 0 for too few.

    ``kind``: "linear", or the basis of cubic ones.
    """
    if kind == "linear":
        segments = counts if wrap == "periodic" else counts - 1
        return np.where(counts < 2, 0, segments)
    if kind == "bezier":
        return np.maximum(counts // 3 if wrap == "periodic" else (counts - 4) // 3 + 1, 0)
    if wrap == "periodic":
        return np.where(counts < 3, 0, counts)
    return np.maximum(counts - 1 if wrap == "pinned" else counts - 3, 0)


def sample_curves(counts: np.ndarray, kind: str, wrap: str, steps: int) -> CurveSamples:
    """``steps`` samples per segment of curves with so many control points each.

    ``pinned`` splines get a phantom point at either end, 2 P0 - P1, so that they reach their ends.
    """
    if kind == "linear":
        steps = 1
    periodic = wrap == "periodic"
    segments = segment_counts(counts, kind, wrap)
    number = np.where(segments > 0, segments * steps + (not periodic), 0)
    curve, local = _numbered(number)
    segment = np.minimum(local // steps, segments[curve] - 1)
    u = (local - segment * steps) / steps
    starts = (np.cumsum(counts) - counts)[curve]

    varying_counts = np.where(segments > 0, segments + (not periodic), 0)
    first = (np.cumsum(varying_counts) - varying_counts)[curve]
    following = segment + 1
    if periodic:
        following = following % varying_counts[curve]
    varying = Weights(
        int(varying_counts.sum()),
        np.stack([first + segment, first + following], axis=1),
        np.stack([1 - u, u], axis=1),
    )

    step, offset = (3, 0) if kind == "bezier" else (1, 0)
    if wrap == "pinned" and kind in ("bspline", "catmullRom"):
        offset = -1
    size = 2 if kind == "linear" else 4
    control = step * segment[:, None] + offset + np.arange(size)
    if kind == "linear":
        point = np.stack([1 - u, u], axis=1)
        slope = np.broadcast_to([-1.0, 1.0], point.shape)
    else:
        powers = np.stack([np.ones_like(u), u, u**2, u**3], axis=1)
        rates = np.stack([np.zeros_like(u), np.ones_like(u), 2 * u, 3 * u**2], axis=1)
        point, slope = powers @ BASES[kind], rates @ BASES[kind]
    sizes = counts[curve][:, None]
    if periodic:
        control = control % sizes
    elif offset:
        before, after = control[:, :1] < 0, control[:, 3:] >= sizes
        for weights in (point, slope):
            _reflect(weights, before[:, 0], 0, 1, 2)
            _reflect(weights, after[:, 0], 3, 2, 1)
        control = np.clip(control, 0, sizes - 1)
    index = starts[:, None] + control
    count = int(counts.sum())
    points = Weights(count, index, point)
    return CurveSamples(
        curve, number, points, Weights(count, index, slope), points, varying, periodic
    )


def _reflect(weights: np.ndarray, where: np.ndarray, phantom: int, end: int, inner: int) -> None:
    """Give the weight of a phantom point 2 P_end - P_inner to these two."""
    share = np.where(where, weights[:, phantom], 0.0)
    weights[:, end] += 2 * share
    weights[:, inner] -= share
    weights[:, phantom] -= share


def sample_hermite(counts: np.ndarray, steps: int) -> CurveSamples:
    """Cubic Hermite curves; ``points`` weigh the points and then, as many, the tangents."""
    segments = np.maximum(counts - 1, 0)
    number = np.where(segments > 0, segments * steps + 1, 0)
    curve, local = _numbered(number)
    segment = np.minimum(local // steps, segments[curve] - 1)
    u = (local - segment * steps) / steps
    powers = np.stack([np.ones_like(u), u, u**2, u**3], axis=1)
    rates = np.stack([np.zeros_like(u), np.ones_like(u), 2 * u, 3 * u**2], axis=1)
    at = (np.cumsum(counts) - counts)[curve] + segment
    total = int(counts.sum())
    index = np.stack([at, at + 1, total + at, total + at + 1], axis=1)
    values = Weights(total, index[:, :2], np.stack([1 - u, u], axis=1))
    return CurveSamples(
        curve,
        number,
        Weights(2 * total, index, powers @ HERMITE),
        Weights(2 * total, index, rates @ HERMITE),
        values,
        values,
    )


def sample_nurbs(
    counts: np.ndarray,
    orders: np.ndarray,
    knots: np.ndarray,
    ranges: np.ndarray,
    point_weights: np.ndarray | None,
    steps: int,
) -> CurveSamples:
    """NURBS curves: ``knots`` of all, end to end; ``ranges`` (curves, 2). Varying primvars have a
    value per control point, as vertex ones."""
    pieces, number = [], np.zeros(len(counts), dtype=np.int64)
    width = int(orders.max(initial=1))
    first = at_knot = 0
    for curve, (count, order) in enumerate(zip(counts, orders, strict=True)):
        own = knots[at_knot : at_knot + count + order]
        at = sample_parameters(own, int(order), *ranges[curve], steps)
        weights, slopes = basis(own, int(order), int(count), at)
        if point_weights is not None:
            weights, slopes = rational(weights, slopes, point_weights[first : first + count])
        pad = ((0, 0), (0, width - int(order)))
        pieces.append(
            (
                np.pad(weights.index + first, pad, mode="edge"),
                np.pad(weights.weight, pad),
                np.pad(slopes.weight, pad),
            )
        )
        number[curve] = len(at)
        first, at_knot = first + int(count), at_knot + int(count + order)
    index, weight, slope = (np.concatenate(part) for part in zip(*pieces, strict=True))
    points = Weights(first, index, weight)
    curve, _ = _numbered(number)
    return CurveSamples(curve, number, points, Weights(first, index, slope), points, points)


def _numbered(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of consecutive runs each item is in, and the how-manieth there."""
    run = np.repeat(np.arange(len(counts)), counts)
    return run, np.arange(len(run)) - np.repeat(np.cumsum(counts) - counts, counts)
