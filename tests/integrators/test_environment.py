"""Several infinite lights act as one environment: their light adds up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from support.rendering import BOTH, pictures
from support.shapes import facing, floor, orthographic
from support.statistics import agreement
from usdmlt import scene as s


@pytest.mark.parametrize("with_lamp", [False, True], ids=["alone", "beside a lamp"])
@pytest.mark.parametrize("integrator", BOTH)
def test_sun_and_sky_light_a_plane_together(integrator: str, with_lamp: bool) -> None:
    """E = π L_sky + π L_sun sin²(angle/2), the sun in the zenith, within 1 %.

    Alone, the two are the only choice there is among lights, and still have to be chosen from. The
    lamp, far off and with its back to the plane, only adds a choice.
    """
    angle, sky, sun, albedo = 50.0, (0.2, 0.3, 0.4), (1.5, 1.2, 1.0), 0.8
    lights: list[s.Light] = [
        s.DomeLight(sky),
        s.DistantLight(sun, angle, facing((0, 1, 0), (0, 0, 0), up=(0, 0, 1))),
    ]
    if with_lamp:
        lights.append(s.RectLight((1.0,) * 3, 1, 1, facing((50, 3, 0), (50, 4, 0), up=(0, 0, 1))))
    camera = orthographic((0, 0.2, 0), (0, 0, 0), 2.0, up=(0, 0, -1))
    white = s.Material(s.Diffuse((albedo,) * 3))
    scene = s.Scene(camera, 9, 6, meshes=[floor(0)], materials=[white], lights=lights)
    disk = math.sin(math.radians(angle / 2)) ** 2
    expected = albedo * (np.array(sky) + np.array(sun) * disk)
    got = pictures(scene, integrator, 16, samples=64, depth=2)
    agreement(got, np.broadcast_to(expected, got.shape[1:])).require(resolution=0.0025)
