"""B-spline bases with knots: the weights of control points at parameters (Cox and de Boor)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from usdmlt.stage.sampled import Weights


def sample_parameters(
    knots: np.ndarray, order: int, low: float, high: float, steps: int
) -> np.ndarray:
    """Parameters from ``low`` to ``high``: every distinct knot, and ``steps`` per span."""
    inner = np.unique(knots[order - 1 : len(knots) - order + 1])
    breaks = np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]])
    pieces = [np.linspace(a, b, steps, endpoint=False) for a, b in pairwise(breaks)]
    return np.concatenate([*pieces, [high]])


def basis(knots: np.ndarray, order: int, count: int, at: np.ndarray) -> tuple[Weights, Weights]:
    """The weights of ``count`` control points, and their derivatives, at parameters ``at``.

    ``knots`` (count + order,), not falling.
    """
    degree = order - 1
    at = np.clip(at, knots[degree], knots[count])
    span = np.clip(np.searchsorted(knots, at, side="right") - 1, degree, count - 1)
    while (empty := knots[span] == knots[span + 1]).any() and (span[empty] > degree).any():
        span = np.where(empty & (span > degree), span - 1, span)  # the last span ends at its knot
    lower = np.ones((len(at), 1))
    weight = lower
    for k in range(1, order):
        lower, weight = weight, _raise(knots, span, at, weight, k)
    index = span[:, None] - degree + np.arange(order)
    return Weights(count, index, weight), Weights(count, index, _slope(knots, span, lower, degree))


def _raise(knots, span, at, weight, k) -> np.ndarray:
    """From the k functions of degree k - 1 that are not zero in a span to the k + 1 of degree k."""
    raised = np.zeros((len(at), k + 1))
    for i in range(k):
        left, right = knots[span - k + 1 + i], knots[span + 1 + i]
        width = right - left
        part = np.divide(weight[:, i], width, out=np.zeros(len(at)), where=width > 0)
        raised[:, i] += (right - at) * part
        raised[:, i + 1] += (at - left) * part
    return raised


def _slope(knots, span, lower, degree) -> np.ndarray:
    """d/dt N_i,p = p (N_i,p-1 / (t_i+p - t_i) - N_i+1,p-1 / (t_i+p+1 - t_i+1))."""
    slope = np.zeros((len(span), degree + 1))
    if degree == 0:
        return slope
    for i in range(degree):
        width = knots[span + 1 + i] - knots[span - degree + 1 + i]
        part = np.divide(degree * lower[:, i], width, out=np.zeros(len(span)), where=width > 0)
        slope[:, i] -= part
        slope[:, i + 1] += part
    return slope


def rational(weights: Weights, slopes: Weights, w: np.ndarray) -> tuple[Weights, Weights]:
    """The same for control points of weights ``w`` (count,): R_i = w_i N_i / sum of w_j N_j."""
    weighted, sloped = weights.weight * w[weights.index], slopes.weight * w[slopes.index]
    total, rise = weighted.sum(axis=1, keepdims=True), sloped.sum(axis=1, keepdims=True)
    return (
        Weights(weights.count, weights.index, weighted / total),
        Weights(weights.count, weights.index, (sloped - weighted * rise / total) / total),
    )
