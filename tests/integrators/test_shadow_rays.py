"""Shadow rays stop short of the surface they are aimed at, wherever the origin of space is."""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import BOTH, picture
from support.shapes import facing, perspective, quad
from usdmlt import scene as s

# A floor in the coordinates of the Cornell box, with a corner at the origin, and a lamp far above:
# coordinates at the corner are small, distances are not.
SIZE, HEIGHT = 559.2, 548.7


def lit_corner(offset: np.ndarray) -> s.Scene:
    def at(x: float, y: float, z: float) -> np.ndarray:
        return np.array([x, y, z]) + offset

    lamp = s.RectLight(
        (40.0,) * 3, 130, 105, facing(at(278, HEIGHT, 279), at(278, 0, 279), up=(0, 0, 1))
    )
    camera = perspective(at(30, 60, 30), at(30, 0, 30), 40, aspect=1, up=(0, 0, 1))
    floor = quad(at(0, 0, SIZE), (SIZE, 0, 0), (0, 0, -SIZE))
    grey = s.Material(s.Diffuse((0.5,) * 3))
    return s.Scene(camera, 16, 16, meshes=[floor], materials=[grey], lights=[lamp])


@pytest.mark.parametrize("integrator", BOTH)
def test_light_reaches_a_floor_near_the_origin(integrator: str) -> None:
    """Moved away from the origin the same floor has the same light: the same random numbers."""
    settings = {"samples": 16, "min_edges": 2, "depth": 2}
    near = picture(lit_corner(np.zeros(3)), integrator, **settings)
    away = picture(lit_corner(np.array([256.0, 128.0, 64.0])), integrator, **settings)
    assert away.min() > 0
    assert np.abs(near / away - 1).max() < 0.02
