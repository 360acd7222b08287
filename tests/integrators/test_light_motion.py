"""Light that moves while the shutter is open, on a plane: the mean over time of the irradiance in
closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from support.irradiance import ALBEDO, expected_picture, of_polygon, plane_under
from support.rendering import ALL, build, picture, pictures, work
from support.shapes import rotate, translate
from support.statistics import agreement, standard_errors
from usdmlt import scene as s

STEPS = 16


def require_mean(scene: s.Scene, expected: np.ndarray) -> None:
    """Of all integrators."""
    built = build(scene)
    assert built.has_motion
    for integrator in ALL:
        got = pictures(built, integrator, 16, depth=2, **work(integrator, 64))
        assert abs(standard_errors(got.mean(axis=(1, 2, 3)), expected.mean())) < 4, integrator
        agreement(got, expected).require(resolution=0.02)


def test_a_rectangle_that_turns_as_it_passes() -> None:
    """Facing down, over x = −1 to 1, and tilted by 20 degrees."""
    down = rotate((1, 0, 0), -90)

    def at(time: float) -> np.ndarray:
        return down @ rotate((0, 0, 1), 20 * time) @ translate(2 * time - 1, 1.2, 0.2)

    assert (np.array([0, 0, -1.0]) @ down[:3, :3]) @ [0, 1, 0] == pytest.approx(-1)
    light = s.RectLight((3, 2, 1), 0.8, 1.1, at(0))
    light.motion = [at(k / STEPS) for k in range(1, STEPS + 1)]
    corners = np.array([(-0.4, -0.55, 0), (0.4, -0.55, 0), (0.4, 0.55, 0), (-0.4, 0.55, 0)])
    times = (np.arange(64) + 0.5) / 64
    places = [corners @ m[:3, :3] + m[3, :3] for m in map(at, times)]
    pictures_ = [expected_picture(of_polygon(place), light.radiance) for place in places]
    require_mean(plane_under(light), np.mean(pictures_, axis=0))


@pytest.mark.parametrize("angle", [0.0, 10.0])
def test_a_sun_that_sinks(angle: float) -> None:
    """From the zenith to 60 degrees: the mean cosine is sin(60°) / (π/3)."""
    up = rotate((1, 0, 0), -90)
    assert (np.array([0, 0, 1.0]) @ up[:3, :3])[1] == pytest.approx(1)
    light = s.DistantLight((1, 2, 3), angle, up)
    turns = np.linspace(0, 60, STEPS + 1)[1:]
    light.motion = [up @ rotate((0, 0, 1), degrees) for degrees in turns]
    size = math.pi * math.sin(math.radians(angle / 2)) ** 2 if angle else 1.0
    mean = size * math.sin(math.pi / 3) / (math.pi / 3)
    expected = np.ones((6, 9, 1)) * mean * np.array([1, 2, 3]) * ALBEDO / math.pi
    require_mean(plane_under(light), expected)


def test_a_dome_s_bright_half_rises() -> None:
    """Half of the dome is white: from below the plane it turns to above it. Irradiance of the half
    that is turned by θ from below is π (1 − cosθ) / 2."""
    image = np.zeros((64, 4, 3), np.float32)
    image[32:] = 1
    light = s.DomeLight((1, 2, 3), texture=0)
    turns = np.linspace(0, 180, STEPS + 1)[1:]
    light.motion = [rotate((0, 0, 1), degrees) for degrees in turns]
    expected = np.ones((6, 9, 1)) * np.array([1, 2, 3]) * ALBEDO / 2
    require_mean(plane_under(light, textures=[s.Texture(image)]), expected)


@pytest.mark.parametrize("integrator", ["path", "bdpt"])
def test_the_camera_sees_where_a_light_was(integrator: str) -> None:
    """A disk of light passes below the camera at right angles to its view; the sum over the picture
    is its area's, and the row that it passes is lit evenly where it was all along."""
    toward_camera = rotate((1, 0, 0), 90)
    assert (np.array([0, 0, -1.0]) @ toward_camera[:3, :3])[1] == pytest.approx(1)
    light = s.DiskLight((1, 1, 1), 0.25, toward_camera @ translate(-1, 0.1, 0))
    light.motion = [toward_camera @ translate(1, 0.1, 0)]
    scene = plane_under(light)
    scene.meshes = []
    scene.camera.window = (-1.5, 1.5, -1, 1)
    scene.width, scene.height = 24, 16
    image = picture(build(scene), integrator, samples=1024, depth=1)[..., 0]
    assert image.mean() * 6 == pytest.approx(math.pi * 0.25**2, rel=0.02)
    # The middle row's pixels, 1/8 high: mean chord over the path's length of 2.
    y = (np.arange(64) + 0.5) / 64 / 8
    chord = 2 * np.sqrt(0.25**2 - y**2).mean()
    assert image[7:9, 8:16].mean() == pytest.approx(chord / 2, rel=0.02)
