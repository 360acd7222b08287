"""A lamp of known intensities over a floor: E = I(θ, φ) cosθ / d²."""

from __future__ import annotations

import math

import numpy as np
import pytest

from support.rendering import build, pictures
from support.shapes import floor, orthographic, rotate, translate
from support.statistics import standard_errors
from usdmlt import scene as s

RADIUS, HEIGHT, SIDE, EXTENT = 0.01, 1.0, 8, 2.0
VERTICAL = np.array([0.0, 15.0, 30.0, 60.0, 90.0])
HORIZONTAL = np.array([0.0, 90.0, 180.0, 270.0, 360.0])
CANDELA = np.array([[9, 7, 5, 1, 0], [9, 3, 8, 2, 0], [9, 8, 1, 1, 0], [9, 5, 2, 6, 0]], float)


@pytest.mark.parametrize("integrator", ["path", "bdpt"])
def test_every_pixel_of_the_floor_has_the_profile_s_illuminance(integrator):
    """The light is turned so that its -z is down; 4 standard errors in each pixel (64 of them, a
    chance of 0.4 % in all), and 1 % is seen in the mean."""
    profile = s.IesProfile(VERTICAL, HORIZONTAL, np.concatenate([CANDELA, CANDELA[:1]]))
    transform = rotate((1, 0, 0), -90) @ translate(0, HEIGHT, 0)
    assert np.allclose(np.array([0, 0, -1]) @ transform[:3, :3], (0, -1, 0))
    light = s.SphereLight(
        (1 / (math.pi * RADIUS**2),) * 3,  # 1 candela where the factor is 1
        radius=RADIUS,
        transform=transform,
        shaping=s.Shaping(ies=profile),
    )
    scene = s.Scene(
        orthographic((0, 0.5, 0), (0, 0, 0), EXTENT, 1.0, up=(0, 0, -1)),
        SIDE,
        SIDE,
        meshes=[floor()],
        materials=[s.Material(s.Diffuse((1.0, 1.0, 1.0)))],
        lights=[light],
    )

    fine = 16  # points per side of a pixel
    x = ((np.arange(SIDE * fine) + 0.5) / (SIDE * fine) - 0.5) * EXTENT
    X, Z = np.meshgrid(x, x)
    to_lamp = np.stack([-X, np.full_like(X, HEIGHT), -Z], -1)
    d2 = (to_lamp**2).sum(-1)
    local = to_lamp @ transform[:3, :3].T / np.sqrt(d2)[..., None]
    theta = np.degrees(np.arccos(local[..., 2])).ravel()
    phi = np.degrees(np.arctan2(local[..., 1], local[..., 0])).ravel() % 360
    rows = np.stack([np.interp(theta, VERTICAL, row) for row in profile.factors])
    intensity = np.array([np.interp(p, HORIZONTAL, rows[:, i]) for i, p in enumerate(phi)])
    illuminance = intensity.reshape(X.shape) * (HEIGHT / np.sqrt(d2)) / d2
    expected = illuminance.reshape(SIDE, fine, SIDE, fine).mean((1, 3)) / math.pi

    got = pictures(build(scene), integrator, 16, samples=64, depth=2)[..., 0]
    errors = standard_errors(got, expected)
    # The lamp is no point: 1e-3 of what it gives may be elsewhere.
    slack = 2e-3 * expected / (got.std(axis=0, ddof=1) / 4)
    assert (np.abs(errors) < 5 + slack).all()
    assert got.mean() == pytest.approx(expected.mean(), rel=0.01)
    assert np.ptp(expected[2:6, 2:6]) > 0.3  # the profile is no symmetric one
