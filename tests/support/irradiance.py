"""A white plane seen from straight above, and the picture of it that an irradiance in closed form
makes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from support.shapes import floor, orthographic
from usdmlt import scene as s

WIDTH, HEIGHT = 9, 6
EXTENT = 2.0  # of the image along z, scene units
ALBEDO = 0.8
UP = np.array([0.0, 1.0, 0.0])

Irradiance = Callable[[np.ndarray], np.ndarray]  # of points (…, 3): (…)


def plane_under(light: s.Light, **content: object) -> s.Scene:
    camera = orthographic((0, 0.2, 0), (0, 0, 0), EXTENT, WIDTH / HEIGHT, up=(0, 0, -1))
    material = s.Material(s.Diffuse((ALBEDO,) * 3))
    return s.Scene(
        camera, WIDTH, HEIGHT, meshes=[floor(0)], materials=[material], lights=[light], **content
    )


def footprints(points: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points of every pixel on the plane, (h, w, n², 3), and their weights."""
    x, w = np.polynomial.legendre.leggauss(points)
    size = EXTENT / HEIGHT
    column = (np.arange(WIDTH) - (WIDTH - 1) / 2)[:, None] * size + x * size / 2
    row = (np.arange(HEIGHT) - (HEIGHT - 1) / 2)[:, None] * size + x * size / 2
    X = np.broadcast_to(column[None, :, None, :], (HEIGHT, WIDTH, points, points))
    Z = np.broadcast_to(row[:, None, :, None], (HEIGHT, WIDTH, points, points))
    p = np.stack([X, np.zeros_like(X), Z], -1).reshape(HEIGHT, WIDTH, -1, 3)
    return p, np.outer(w, w).ravel() / 4


def expected_picture(irradiance: Irradiance, color: tuple[float, ...]) -> np.ndarray:
    points, weights = footprints()
    mean = irradiance(points) @ weights
    return mean[..., None] * np.array(color) * ALBEDO / math.pi


def of_polygon(corners: np.ndarray) -> Irradiance:
    """Lambert (1760): E = ½ Σ Γᵢ·n, Γᵢ the angle an edge subtends times its plane's normal."""

    def irradiance(points: np.ndarray) -> np.ndarray:
        sum_ = 0.0
        r = corners - points[..., None, :]
        r /= np.linalg.norm(r, axis=-1, keepdims=True)
        for i in range(len(corners)):
            a, b = r[..., i, :], r[..., (i + 1) % len(corners), :]
            normal = np.cross(a, b)
            sine = np.linalg.norm(normal, axis=-1)
            angle = np.arctan2(sine, (a * b).sum(-1))
            sum_ = sum_ + normal @ UP / sine * angle
        return abs(sum_) / 2

    return irradiance
