"""4x4 matrices that act on row vectors, as USD's do."""

from __future__ import annotations

import numpy as np

# A linear map is singular where its determinant is below this fraction of what the lengths of its
# rows allow.
SINGULAR = 1e-14


def singular(transforms: np.ndarray) -> np.ndarray:
    """(...) bool: which of (..., 4, 4) matrices flatten space or are not finite."""
    linear = transforms[..., :3, :3]
    finite = np.isfinite(transforms).all(axis=(-1, -2))
    safe = np.where(finite[..., None, None], linear, 0.0)
    limit = SINGULAR * np.prod(np.linalg.norm(safe, axis=-1), axis=-1)
    result = ~finite | ~(np.abs(np.linalg.det(safe)) > limit)
    projects = finite & (transforms[..., 3] != (0, 0, 0, 1)).any(axis=-1)
    if projects.any():  # where the linear part may be regular, and the whole is not
        whole = np.where(projects[..., None, None], transforms, np.eye(4))
        result = result | (np.linalg.slogdet(whole)[0] == 0)
    return result
