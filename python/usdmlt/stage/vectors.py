"""Products of arrays of vectors, (..., 3). NumPy's own cross is slow on small arrays."""

from __future__ import annotations

import numpy as np


def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """u x v."""
    result = np.empty(np.broadcast_shapes(u.shape, v.shape))
    result[..., 0] = u[..., 1] * v[..., 2] - u[..., 2] * v[..., 1]
    result[..., 1] = u[..., 2] * v[..., 0] - u[..., 0] * v[..., 2]
    result[..., 2] = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return result


def dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """u · v."""
    return u[..., 0] * v[..., 0] + u[..., 1] * v[..., 1] + u[..., 2] * v[..., 2]
