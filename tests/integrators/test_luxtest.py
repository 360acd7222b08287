"""The frames of the UsdLux conformance scenes against their irradiance integral.

Set USDMLT_ASSETS to a folder that holds them (luxtest/usd/rect.usda, disk.usda, sphere.usda,
dome.usda) to run these. Their material is put aside for white Lambert (as UsdPreviewSurface it has
a Fresnel layer, and this is about light), so a pixel of direct light on the floor is E/π with

    E = ∫ L(ω) S(ω) V cosθ cosθ' / r² dA,

integrated here by a midpoint rule over the light's surface, with the shaping formulas of UsdLux and
the shadow of the one small rectangle on the floor. Nothing of usdmlt but the stage reader is used
for it; intensity, exposure, normalisation and temperature are the reader's and have tests of their
own with numbers from the schema.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student

from support.rendering import picture, pictures
from support.shapes import floor, orthographic
from support.statistics import sidak
from usdmlt import scene as s
from usdmlt.stage import load

FOLDER = Path(os.environ.get("USDMLT_ASSETS", "/nonexistent")) / "luxtest" / "usd"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="USDMLT_ASSETS has no luxtest")

WIDTH = 32
SEEDS = 16
SUB = 2  # points per side of a pixel in the integral


def light_points(light: s.Light, n: int = 24) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """World positions, normals of the emitting side and areas of a grid on the light."""
    u, v = (np.stack(np.meshgrid(*[(np.arange(n) + 0.5) / n] * 2), -1).reshape(-1, 2)).T
    down = np.tile((0.0, 0.0, -1.0), (n * n, 1))
    match light:
        case s.RectLight():
            local = np.stack([(u - 0.5) * light.width, (v - 0.5) * light.height, 0 * u], 1)
            area = np.full(n * n, light.width * light.height / n**2)
            normal = down
        case s.DiskLight():
            r, phi = light.radius * np.sqrt(u), 2 * math.pi * v
            local = np.stack([r * np.cos(phi), r * np.sin(phi), 0 * r], 1)
            area = np.full(n * n, math.pi * light.radius**2 / n**2)
            normal = down
        case s.SphereLight():
            z, phi = 2 * u - 1, 2 * math.pi * v
            r = np.sqrt(1 - z * z)
            normal = np.stack([r * np.cos(phi), r * np.sin(phi), z], 1)
            local = light.radius * normal
            area = np.full(n * n, 4 * math.pi * light.radius**2 / n**2)
    m = light.transform
    return local @ m[:3, :3] + m[3, :3], normal @ m[:3, :3], area


def shaped(light: s.Light, direction: np.ndarray) -> np.ndarray:
    """Radiance in directions (…, 3) that leave the light: (…, 3)."""
    radiance = np.broadcast_to(np.asarray(light.radiance), direction.shape)
    shaping = light.shaping
    if shaping is None:
        return radiance
    axis = -light.transform[2, :3]
    c = np.clip(direction @ axis, -1, 1)
    f = np.abs(c)[..., None] ** shaping.focus
    tint = np.asarray(shaping.focus_tint)
    high = math.radians(shaping.cone_angle_degrees)
    low = high * (1 - shaping.cone_softness)
    t = np.clip((np.arccos(c) - low) / max(high - low, 1e-9), 0, 1)
    cone = 1 - t * t * (3 - 2 * t)
    return radiance * (tint + (1 - tint) * f) * cone[..., None]


def blocked(a: np.ndarray, b: np.ndarray, quad: np.ndarray) -> np.ndarray:
    """Whether segments a–b cross a rectangle given by corner and two edges."""
    corner, eu, ev = quad
    n = np.cross(eu, ev)
    d = b - a
    t = ((corner - a) @ n) / (d @ n)
    p = a + d * t[..., None] - corner
    u, v = p @ eu / (eu @ eu), p @ ev / (ev @ ev)
    return (t > 0) & (t < 1) & (u > 0) & (u < 1) & (v > 0) & (v < 1)


def expected_picture(scene: s.Scene, points: int) -> tuple[np.ndarray, np.ndarray]:
    """E/π per pixel, by ``points`` squared of them, and which pixels see only the floor at a
    distance from edges."""
    x, y, z = scene.camera.transform[3, :3]
    assert (x, z) == (0, 0)
    left, right, bottom, top = scene.camera.window
    sub = (np.arange(WIDTH * points) + 0.5) / (WIDTH * points)
    column, row = np.meshgrid(sub, sub)
    # The camera looks down −y with −z up in the picture.
    px = (left + (right - left) * column) * y
    pz = -(top - (top - bottom) * row) * y
    ground = np.stack([px, 0 * px, pz], -1).reshape(-1, 1, 3)

    small = next(mesh for mesh in scene.meshes if "angled" in mesh.name)
    corners = small.points @ small.transform[:3, :3] + small.transform[3, :3]
    corner = corners[np.argmin(corners @ (1, 10, 0))]
    eu = corners[np.argmax(corners @ (10, -1, 0))] - corner
    ev = corners[np.argmax(corners @ (-1, 10, 0))] - corner

    light = scene.lights[0]
    p, n, area = light_points(light)
    quad = np.array([corner, eu, ev])

    def at(ground: np.ndarray) -> np.ndarray:
        d = ground - p
        r2 = (d * d).sum(-1)
        w = d / np.sqrt(r2)[..., None]
        cosines = np.maximum((w * n).sum(-1), 0) * np.maximum(-w[..., 1], 0)
        visible = ~blocked(np.broadcast_to(p, d.shape), np.broadcast_to(ground, d.shape), quad)
        weight = cosines / r2 * area * visible
        return (shaped(light, w) * weight[..., None]).sum(1) / math.pi

    e = np.concatenate([at(part) for part in np.array_split(ground, WIDTH * points)])
    e = e.reshape(WIDTH, points, WIDTH, points, 3)
    mean = e.mean((1, 3))
    smooth = np.ptp(e, axis=(1, 3)).max(-1) < 0.5 * mean.max(-1)  # no edge of a shadow or cone
    seen = (np.abs(px) < 4.5) & (np.abs(pz) < 4.5) & ((np.abs(px) > 1.3) | (pz > 1.9) | (pz < -1.9))
    return mean, seen.reshape(WIDTH, points, WIDTH, points).all((1, 3)) & smooth


QUICK = (1, 8, 12, 17, 33, 43)
# The light is close to the floor there, or its cone soft or narrow: few pixels are lit, by fine
# detail. What is in the very middle is not looked at: of frame 25's cone next to nothing is left.
FINE = (21, 22, 23, 24, 25, 29, 30)
FRAMES = [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in range(1, 56)]


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("name", ["rect", "disk", "sphere"])
def test_the_floor_is_lit_as_the_integral_says(name: str, frame: int) -> None:
    """Every pixel of the open floor, at a family-wise significance of 1e-4 per frame."""

    scene = load(FOLDER / f"{name}.usda", frame=frame, width=WIDTH)
    assert scene.height == WIDTH
    scene.materials = [s.Material(s.Diffuse((1.0, 1.0, 1.0)))] * len(scene.materials)
    expected, open_floor = expected_picture(scene, 6 if frame in FINE else SUB)
    lit = open_floor & (expected.max(-1) > 1e-3 * expected.max())
    if frame == 25 and not lit.any():
        dark = picture(scene, "path", samples=64, depth=2)[open_floor]
        assert (dark == 0).all()
        return
    assert lit.sum() > (1 if frame in FINE else 40)
    got = pictures(scene, "path", SEEDS, samples=64, depth=2)[:, lit]
    mean, error = got.mean(0), got.std(0, ddof=1) / math.sqrt(SEEDS)
    # The midpoint rule's own error: it shrinks with the square of the grid.
    error = np.hypot(error, 2e-3 * expected[lit] + 1e-9)

    p = 2 * student.sf(np.abs(mean - expected[lit]) / error, SEEDS - 1)
    assert sidak(p) > 1e-4, (name, frame, float((mean / expected[lit]).mean()))
    # The integral's own error: with other numbers of points it changes by as much. Of frame 25's
    # cone two pixels are looked at, at its edge.
    slack = 2e-2 if frame == 25 else 1e-2 if frame in FINE else 5e-3
    assert mean.sum() == pytest.approx(expected[lit].sum(), rel=slack)


# ---------------------------------------------------------------------------------------------
# dome: a picture of labelled squares all around, and nothing but the camera


def lookup(pixels: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The texel of directions (…, 3), nearest: t = acos(y)/π, s = 1/2 − atan2(x, z)/2π."""
    height, width = pixels.shape[:2]
    t = np.arccos(np.clip(d[..., 1], -1, 1)) / math.pi
    turn = 0.5 - np.arctan2(d[..., 0], d[..., 2]) / (2 * math.pi)
    row = np.minimum((t * height).astype(int), height - 1)
    return pixels[row, (turn * width).astype(int) % width].astype(np.float64)


def test_the_dome_is_seen_as_its_image_says() -> None:
    """Every pixel is the mean of the texels that it covers."""
    scene = load(FOLDER / "dome.usda", frame=1, width=WIDTH)
    (light,) = scene.lights
    image = scene.textures[light.texture].linear()[..., :3]
    left, right, bottom, top = scene.camera.window
    n = 16
    sub = (np.arange(WIDTH * n) + 0.5) / (WIDTH * n)
    column, row = np.meshgrid(sub, sub)
    local = np.stack([left + (right - left) * column, top - (top - bottom) * row, 0 * row - 1], -1)
    d = local @ scene.camera.transform[:3, :3]
    seen = lookup(image, d / np.linalg.norm(d, axis=-1, keepdims=True)) * light.radiance
    expected = seen.reshape(WIDTH, n, WIDTH, n, 3).mean((1, 3))
    spread = seen.reshape(WIDTH, n, WIDTH, n, 3).std((1, 3)).max()
    got = pictures(scene, "path", 4, samples=256, depth=1)
    assert np.ptp(expected) > 0.3
    # 1024 samples of a pixel: five standard errors of the widest spread, and 256 points.
    assert np.abs(got.mean(0) - expected).max() < 5 * spread * (1 / 32 + 1 / 16)
    assert got.mean() == pytest.approx(expected.mean(), rel=2e-3)


@pytest.mark.parametrize(
    "rows",
    [
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
        ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    ],
    ids=["as it is", "up to the left", "up ahead", "upside down"],
)
def test_a_floor_under_the_dome_has_the_irradiance_of_its_image(rows) -> None:
    """E = ∫ L cosθ dω over the texels of the half of the image above; the dome turned."""
    scene = load(FOLDER / "dome.usda", frame=1, width=8)
    (light,) = scene.lights
    image = scene.textures[light.texture].linear()[..., :3].astype(np.float64)
    light.transform[:3, :3] = rows
    height, width = image.shape[:2]
    theta = (np.arange(height) + 0.5)[:, None] / height * math.pi
    turn = (0.5 - (np.arange(width) + 0.5)[None] / width) * 2 * math.pi
    d = [np.sin(theta) * np.sin(turn), np.cos(theta) + 0 * turn, np.sin(theta) * np.cos(turn)]
    up = (np.stack(d, -1) @ np.array(rows, float))[..., 1]
    solid_angle = 2 * math.pi**2 * np.sin(theta) / (width * height)
    weight = np.maximum(up, 0) * solid_angle
    expected = (image * weight[..., None]).sum((0, 1)) * light.radiance / math.pi

    scene.meshes = [floor()]
    scene.camera = orthographic((0, 1, 0), (0, 0, 0), 2.0, 1.0, up=(0, 0, -1))
    scene.materials = [s.Material(s.Diffuse((1.0, 1.0, 1.0)))]
    for integrator in ("path", "bdpt"):
        got = pictures(scene, integrator, 8, samples=256, depth=2).mean((1, 2))
        mean, error = got.mean(0), got.std(0, ddof=1) / math.sqrt(8)
        assert (error < 0.01 * mean).all()
        assert (np.abs(mean - expected) < 6 * error + 2e-3 * expected).all(), integrator
