"""The importance map of mlt follows the edges that the camera sees.

A map that mixes the two sides of an edge takes the dark one for bright: it gets too few mutations
there, and its pixels along the edge are noisier than the others.
"""

from __future__ import annotations

import usdmlt.scene as s
from support.rendering import pictures
from support.shapes import facing, orthographic, quad

WIDTH, HEIGHT = 64, 32
EDGE = 32  # column at which the lower sheet begins


def scene() -> s.Scene:
    """From above: a sheet under a lamp, and beside it one of the same white, far below."""
    white = s.Material(s.Diffuse((0.7, 0.7, 0.7)))
    return s.Scene(
        camera=orthographic((0, 3, 0), (0, 0, 0), 2.0, aspect=2, up=(0, 0, -1)),
        width=WIDTH,
        height=HEIGHT,
        meshes=[
            quad((-2.2, 1, 1.2), (2.2, 0, 0), (0, 0, -2.4)),
            quad((-0.2, -9, 1.2), (2.4, 0, 0), (0, 0, -2.4)),
        ],
        materials=[white],
        lights=[s.RectLight((6, 6, 6), 0.8, 0.8, facing((-1, 1.8, -1.8), (-0.6, 1, 0)))],
    )


def test_what_is_dark_beside_an_edge_is_no_noisier_than_what_is_dark_elsewhere() -> None:
    """By 24 seeds and 32 rows; a map of the mixed brightness makes it three times as noisy."""
    settings = {"samples": 64, "depth": 3, "direct": "mlt", "selective": False}
    seen = pictures(scene(), "mlt", 24, **settings).mean(axis=-1)
    mean = seen.mean(axis=(0, 1))
    bright, dark = mean[EDGE - 12 : EDGE].mean(), mean[EDGE:].mean()
    assert bright > 8 * dark > 0
    relative = (seen.var(axis=0, ddof=1) / seen.mean(axis=0) ** 2).mean(axis=0)
    assert relative[EDGE + 1 : EDGE + 4].mean() < 1.5 * relative[EDGE + 8 : EDGE + 24].mean()
