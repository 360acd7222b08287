"""Direct light on a diffuse plane against the irradiance known in closed form.

An orthographic camera looks straight down on a white plane y = 0, so a pixel's radiance is the
mean of E/π over its footprint; the mean is taken with Gauss points. These see wrong radiance or
area of a light, a missing cosine or 1/r², wrong density of a light's samples, and a wrong weight of
next-event estimation against BSDF sampling and light tracing, each in absolute terms: agreement of
two integrators cannot see a factor that both lack.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from support.irradiance import (
    ALBEDO,
    HEIGHT,
    UP,
    WIDTH,
    Irradiance,
    expected_picture,
    footprints,
    of_polygon,
    plane_under,
)
from support.rendering import BOTH, build, picture, pictures
from support.scenes import sky
from support.shapes import facing, mesh, rotate, scale, translate
from support.statistics import agreement, standard_errors
from usdmlt import scene as s


def require_picture(scene: s.Scene, expected: np.ndarray) -> None:
    """Of both integrators: the mean within 4 standard errors, and every pixel and block."""
    built = build(scene)
    for integrator in BOTH:
        got = pictures(built, integrator, 16, samples=64, depth=2)
        assert abs(standard_errors(got.mean(axis=(1, 2, 3)), expected.mean())) < 4, integrator
        agreement(got, expected).require(resolution=0.01)


def require_irradiance(light: s.Light, irradiance: Irradiance) -> None:
    """``irradiance``: of unit radiance."""
    require_picture(plane_under(light), expected_picture(irradiance, light.radiance))


# ---------------------------------------------------------------------------------------------
# Irradiance of unit radiance


def of_parallel_disk(center: tuple[float, ...], radius: float) -> Irradiance:
    """Configuration factor of a disk in a parallel plane (Howell's catalogue, B-15)."""

    def irradiance(points: np.ndarray) -> np.ndarray:
        h2 = center[1] ** 2
        d2 = (points[..., 0] - center[0]) ** 2 + (points[..., 2] - center[2]) ** 2
        r2 = radius**2
        root = np.sqrt((h2 + d2 + r2) ** 2 - 4 * r2 * d2)
        return math.pi / 2 * (1 - (h2 + d2 - r2) / root)

    return irradiance


def of_sphere(center: tuple[float, ...], radius: float) -> Irradiance:
    """E = π (R/d)² cosθ of a sphere above the horizon."""

    def irradiance(points: np.ndarray) -> np.ndarray:
        to = np.array(center) - points
        d = np.linalg.norm(to, axis=-1)
        return math.pi * radius**2 / d**3 * (to @ UP)

    return irradiance


def of_surface(p: np.ndarray, area_normal: np.ndarray, emitted=lambda w: 1.0) -> Irradiance:
    """Quadrature over surface elements p (n, 3) of one-sided emission; normals times area.

    `emitted`: factor of the radiance along unit directions that leave the light.
    """

    def irradiance(points: np.ndarray) -> np.ndarray:
        d = p - points[..., None, :]
        r2 = (d * d).sum(-1)
        cosines = np.maximum(d @ UP, 0) * np.maximum(-(d * area_normal).sum(-1), 0)
        return (cosines / r2**2 * emitted(-d / np.sqrt(r2)[..., None])).sum(-1)

    return irradiance


def parametric(surface: Callable, n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Midpoints and area normals of surface(u, v), (u, v) in the unit square."""
    u, v = ((np.arange(k) + 0.5) / k for k in (n, m))
    u, v = (x.ravel() for x in np.meshgrid(u, v, indexing="ij"))
    e = 1e-5
    du = (surface(u + e, v) - surface(u - e, v)) / (2 * e)
    dv = (surface(u, v + e) - surface(u, v - e)) / (2 * e)
    return surface(u, v), np.cross(du, dv) / (n * m)


def placed(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3] + matrix[3, :3]


# ---------------------------------------------------------------------------------------------


def test_rect_light() -> None:
    """Tilted, turned and scaled without uniformity."""
    m = rotate((0, 0, 1), 20) @ scale(1.5, 0.8, 1) @ facing((0.6, 1.2, 0.3), (0.1, 0, 0))
    corners = placed(m, np.array([[x, y, 0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]) / 2)
    light = s.RectLight((3, 2, 1), 1.0, 1.0, m)
    require_irradiance(light, of_polygon(corners))


def test_emissive_mesh() -> None:
    """A mesh's triangle emits the same to both sides: its back is turned to the plane here."""
    corners = np.array([(-0.4, 0.9, 0.3), (0.9, 1.2, 0.2), (0.2, 0.8, -0.7)])
    assert np.cross(corners[1] - corners[0], corners[2] - corners[0])[1] > 0
    scene = plane_under(s.DomeLight((0, 0, 0)))
    scene.materials.append(s.Material(s.UniformEmission((2, 2, 2))))
    scene.meshes.append(mesh(corners, [(0, 1, 2)], 1))
    require_picture(scene, expected_picture(of_polygon(corners), (2, 2, 2)))


def test_disk_light() -> None:
    """Parallel to the plane."""
    m = facing((0.5, 1.1, -0.3), (0.5, 0, -0.3), (0, 0, 1))
    light = s.DiskLight((1, 2, 3), 0.6, m)
    irradiance = of_parallel_disk((0.5, 1.1, -0.3), 0.6)
    require_irradiance(light, irradiance)


def test_elliptic_tilted_disk_light() -> None:
    m = scale(1.4, 0.6, 1) @ facing((-0.8, 1.0, 0.2), (0, 0, 0))

    def surface(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        # v first: the area normal points along -z, to where it emits.
        r, phi = 0.5 * np.sqrt(u), 2 * np.pi * v
        return placed(m, np.stack([r * np.sin(phi), r * np.cos(phi), 0 * u], -1))

    elements = parametric(surface, 60, 120)
    require_irradiance(s.DiskLight((2, 2, 2), 0.5, m), of_surface(*elements))


def test_sphere_light() -> None:
    center = (0.4, 0.9, 0.2)
    light = s.SphereLight((5, 4, 3), 0.4, translate(*center))
    require_irradiance(light, of_sphere(center, 0.4))


def test_small_sphere_light() -> None:
    """The fourth power of its radius-to-distance ratio must not be lost to rounding."""
    center = (0.0, 2.0, 0.0)
    light = s.SphereLight((1e6, 1e6, 1e6), 1e-3, translate(*center))
    require_irradiance(light, of_sphere(center, 1e-3))


def test_ellipsoid_light() -> None:
    m = scale(1.5, 0.5, 0.8) @ rotate((1, 1, 0), 50) @ translate(-0.3, 1.1, 0)

    def surface(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        z, phi = 1 - 2 * u, 2 * np.pi * v
        r = np.sqrt(1 - z * z)
        return placed(m, 0.5 * np.stack([r * np.cos(phi), r * np.sin(phi), z], -1))

    elements = parametric(surface, 96, 96)
    require_irradiance(s.SphereLight((2, 2, 2), 0.5, m), of_surface(*elements))


def test_cylinder_light() -> None:
    """Emits outward from its side; its ends are open and dark."""
    m = rotate((0, 0, 1), 25) @ translate(0.3, 1.0, -0.2)

    def surface(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        phi = 2 * np.pi * v
        return placed(m, np.stack([1.2 * (u - 0.5), 0.2 * np.sin(phi), 0.2 * np.cos(phi)], -1))

    elements = parametric(surface, 96, 96)
    require_irradiance(s.CylinderLight((3, 3, 3), 0.2, 1.2, m), of_surface(*elements))


def test_disk_light_with_a_focus() -> None:
    """UsdLux: radiance · cosⁿ of the angle to the light's axis."""
    m = facing((0.3, 1.0, 0.0), (0, 0, 0.2))
    axis = placed(m, np.array([0, 0, -1.0])) - m[3, :3]

    def surface(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        r, phi = 0.3 * np.sqrt(u), 2 * np.pi * v
        return placed(m, np.stack([r * np.sin(phi), r * np.cos(phi), 0 * u], -1))

    elements = parametric(surface, 40, 60)
    light = s.DiskLight((4, 4, 4), 0.3, m, s.Shaping(focus=5.0))
    irradiance = of_surface(*elements, emitted=lambda w: np.abs(w @ axis) ** 5)
    require_irradiance(light, irradiance)


@pytest.mark.parametrize("angle", [0.0, 0.53, 40.0])
def test_distant_light(angle: float) -> None:
    """E = π sin²α cosθ of a disk in the sky; E = L cosθ where the angle is 0."""
    light = s.DistantLight((3, 2, 1), angle, rotate((1, 0, 0.5), -55))
    cosine = float(light.transform[2, :3] @ UP)  # of local +z, where it comes from
    assert cosine > 0.5
    factor = math.pi * math.sin(math.radians(angle / 2)) ** 2 if angle else 1.0
    require_irradiance(light, lambda p: np.full(p.shape[:-1], factor * cosine))


def test_constant_dome() -> None:
    require_irradiance(s.DomeLight((2, 2, 2)), lambda p: np.full(p.shape[:-1], math.pi))


def test_textured_dome() -> None:
    """A turned lat-long texture: E of the bilinear interpolation between texel centres.

    Sees a flipped or transposed image and a wrong density of its importance sampling.
    """
    turn = rotate((1, 2, 3), 75)
    texture = sky()
    h, w, _ = texture.shape
    n = 1024
    cos_theta = (np.arange(n // 2) + 0.5) / (n // 2)  # the upper hemisphere, equal solid angles
    phi = 2 * np.pi * (np.arange(n) + 0.5) / n
    sine = np.sqrt(1 - cos_theta**2)
    world = np.stack(np.broadcast_arrays(
        sine[:, None] * np.sin(phi), cos_theta[:, None], sine[:, None] * np.cos(phi)
    ), -1)  # fmt: skip
    d = world @ turn[:3, :3].T
    x = (0.5 - np.arctan2(d[..., 0], d[..., 2]) / (2 * np.pi)) * w - 0.5
    y = np.arccos(np.clip(d[..., 1], -1, 1)) / np.pi * h - 0.5
    j, i = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - j)[..., None], (y - i)[..., None]
    # Beyond the outermost rows' centres they repeat; columns wrap around.
    at = lambda a, b: texture[np.clip(a, 0, h - 1), b % w]  # noqa: E731
    radiance = (at(i, j) * (1 - fx) + at(i, j + 1) * fx) * (1 - fy) + (
        at(i + 1, j) * (1 - fx) + at(i + 1, j + 1) * fx) * fy  # fmt: skip
    E = (radiance * cos_theta[:, None, None]).mean(axis=(0, 1)) * 2 * np.pi

    light = s.DomeLight((1, 1, 1), 0, turn)
    expected = np.broadcast_to(E * ALBEDO / np.pi, (HEIGHT, WIDTH, 3))
    require_picture(plane_under(light, textures=[s.Texture(texture)]), expected)


def test_textured_rect_light() -> None:
    """The image as one sees it who stands before the light: its top left at (+x, +y), looking
    along +z. One channel per quadrant tells a flip or a transposition."""
    pixels = np.zeros((2, 2, 3), np.float32)
    pixels[0, 0, 0] = pixels[0, 1, 1] = pixels[1, 0, 2] = 8.0
    texture = s.Texture(pixels, "clamp", "clamp")
    m = facing((0, 0.5, 0), (0, 0, 0), (0, 0, -1))
    light = s.RectLight((1, 1, 1), 1.0, 1.0, m, 0)
    scene = plane_under(light, textures=[texture])

    def emitted(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Bilinear: u, v from the image's top left corner."""
        x, y = np.clip(u * 2 - 0.5, 0, 1)[:, None], np.clip(v * 2 - 0.5, 0, 1)[:, None]
        top = pixels[0, 0] * (1 - x) + pixels[0, 1] * x
        bottom = pixels[1, 0] * (1 - x) + pixels[1, 1] * x
        return top * (1 - y) + bottom * y

    n = 60
    g = (np.arange(n) + 0.5) / n
    u, v = (a.ravel() for a in np.meshgrid(g, g))
    p = placed(m, np.stack([0.5 - u, 0.5 - v, 0 * u], -1))
    area_normal = np.broadcast_to([0, -1 / n**2, 0], p.shape)
    points, weights = footprints()
    expected = np.zeros((HEIGHT, WIDTH, 3))
    colors = emitted(u, v)
    for row in range(HEIGHT):
        for column in range(WIDTH):
            d = p - points[row, column][:, None]
            r2 = (d * d).sum(-1)
            g_term = d[..., 1] * -(d * area_normal).sum(-1) / r2**2
            expected[row, column] = weights @ (g_term @ colors)
    require_picture(scene, expected * ALBEDO / np.pi)


def test_unlit_side_is_black() -> None:
    """Rects and disks emit to one side; a plane behind them gets nothing at all."""
    up = facing((0, 0.8, 0), (0, 2, 0), (0, 0, 1))
    scene = plane_under(s.RectLight((1, 1, 1), 1, 1, up))
    scene.lights.append(s.DiskLight((1, 1, 1), 1, up @ translate(0.5, 0.1, 0)))
    for integrator in BOTH:
        assert not picture(scene, integrator, samples=64, depth=2).any()
