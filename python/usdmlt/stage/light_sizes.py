"""World-space sizes of lights, that ``normalize`` divides by.

``linear`` (3, 3): rows are where a light's x, y and z go. Scale counts, as in hdEmbree.
"""

from __future__ import annotations

import math

import numpy as np


def rect_area(linear: np.ndarray, width: float, height: float) -> float:
    """The area of the parallelogram that a rectangle becomes."""
    return float(np.linalg.norm(np.cross(linear[0] * width, linear[1] * height)))


def disk_area(linear: np.ndarray, radius: float) -> float:
    """The area of the ellipse that a disk becomes."""
    return math.pi * radius**2 * float(np.linalg.norm(np.cross(linear[0], linear[1])))


def sphere_area(linear: np.ndarray, radius: float) -> float:
    """The area of an ellipsoid by Thomsen's formula, p = 1.6075 (within 1.1 %; exact for spheres).

    The semi-axes are the singular values of the transform.
    """
    a, b, c = radius * np.linalg.svd(linear, compute_uv=False)
    p = 1.6075
    mean = ((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3
    return float(4 * math.pi * mean ** (1 / p))


def cylinder_area(linear: np.ndarray, radius: float, length: float) -> float:
    """The lateral area: the ellipse's perimeter (Ramanujan 1914) times the length, no caps."""
    a, b = radius * np.linalg.norm(linear[1]), radius * np.linalg.norm(linear[2])
    h = ((a - b) / (a + b)) ** 2
    perimeter = math.pi * (a + b) * (1 + 3 * h / (10 + math.sqrt(4 - 3 * h)))
    return float(perimeter * length * np.linalg.norm(linear[0]))


def distant_size(angle_degrees: float) -> float:
    """The solid angle, weighted by the cosine, of a distant light: radiance 1 gives this many lux.

    θ = angle / 2: π sin²θ up to a hemisphere, π (2 - sin²θ) beyond; 1 for a Dirac light.
    """
    theta = min(max(math.radians(angle_degrees) / 2, 0.0), math.pi)
    if theta == 0:
        return 1.0
    sine2 = math.sin(theta) ** 2
    return math.pi * sine2 if theta <= math.pi / 2 else math.pi * (2 - sine2)
