"""Where a path may have one edge more, path tracing follows all Dirac components at once."""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import picture
from support.shapes import facing, floor, orthographic
from usdmlt import scene as s

IOR = 1.5
LAMPS = (3.0, 5.0)  # above and below


def fresnel(cosine: float, ior: float) -> float:
    """Unpolarised reflectance of a dielectric, from outside (Born and Wolf)."""
    refracted = np.sqrt(1 - (1 - cosine**2) / ior**2)
    s_polarised = (cosine - ior * refracted) / (cosine + ior * refracted)
    p_polarised = (ior * cosine - refracted) / (ior * cosine + refracted)
    return float(s_polarised**2 + p_polarised**2) / 2


@pytest.mark.parametrize("degrees", [20, 60])
@pytest.mark.parametrize("covered", [False, True])
def test_both_sides_of_glass_without_noise(degrees: float, covered: bool) -> None:
    """Lamps on both sides of a glass floor; a rough layer on it takes no share of the light."""
    angle = np.radians(degrees)
    eye = (0.0, 10 * np.cos(angle), 10 * np.sin(angle))
    camera = orthographic(eye, (0, 0, 0), 0.5)
    glass = s.Dielectric(IOR, 0.0, scatter_mode="RT")
    closure = s.Layer(s.Dielectric(IOR, 0.3, weight=0.0), glass) if covered else glass
    lamps = [
        s.RectLight((radiance,) * 3, 200, 200, facing((0, y, 0), (0, 0, 0), (0, 0, 1)))
        for radiance, y in zip(LAMPS, (20.0, -20.0), strict=True)
    ]
    scene = s.Scene(camera, 12, 8, meshes=[floor(0)], materials=[s.Material(closure)], lights=lamps)
    reflected = fresnel(np.cos(angle), IOR)
    expected = LAMPS[0] * reflected + LAMPS[1] * (1 - reflected) / IOR**2
    found = picture(scene, samples=1, min_edges=2, depth=2)
    assert np.abs(found / expected - 1).max() < 1e-4
