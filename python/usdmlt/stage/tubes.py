"""Curves given a width: tubes around them, or ribbons that face along normals."""

from __future__ import annotations

import numpy as np

from usdmlt.stage.vectors import cross, dot

GOLDEN = (5**0.5 - 1) / 2


def directions(points: np.ndarray, slopes: np.ndarray, curve: np.ndarray, closed: bool):
    """(n, 3) unit tangents: those of the ``slopes``, and where these vanish the way from the sample
    before to the one after."""
    before, after = neighbors(curve, closed)
    chord = points[after] - points[before]
    length = np.linalg.norm(slopes, axis=1, keepdims=True)
    reach = np.linalg.norm(chord, axis=1, keepdims=True)
    tangents = np.divide(slopes, length, out=np.zeros_like(points), where=length > 1e-12 * reach)
    still = ~tangents.any(axis=1)
    chord = np.divide(chord, reach, out=np.zeros_like(chord), where=reach > 0)
    tangents[still] = chord[still]
    tangents[~tangents.any(axis=1)] = (0.0, 0.0, 1.0)
    return tangents


def mitred(points: np.ndarray, curve: np.ndarray, closed: bool) -> np.ndarray:
    """(n, 3) unit tangents of polylines: half-way between the segments at each point."""
    before, after = neighbors(curve, closed)
    sides = []
    for step in (points - points[before], points[after] - points):
        length = np.linalg.norm(step, axis=1, keepdims=True)
        sides.append(np.divide(step, length, out=np.zeros_like(step), where=length > 0))
    return directions(points, sides[0] + sides[1], curve, closed)


def neighbors(curve: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """(n,) the sample before and after each, itself at an end of an open curve."""
    item = np.arange(len(curve))
    change = np.flatnonzero(np.diff(curve)) + 1
    first = np.concatenate([[0], change]).astype(np.int64)
    last = np.concatenate([change - 1, [len(curve) - 1]]).astype(np.int64)
    before, after = item - 1, item + 1
    before[first] = last if closed else first
    after[last] = first if closed else last
    return before, after


def transported_frames(tangents: np.ndarray, counts: np.ndarray, closed: bool) -> np.ndarray:
    """(n, 3) unit vectors across the tangents that turn as little as possible along each curve:
    parallel transport by the least rotation from tangent to tangent. On closed curves what is left
    over is spread along them."""
    across = np.zeros_like(tangents)
    starts = (np.cumsum(counts) - counts)[counts > 0]
    counts = counts[counts > 0]
    axis = np.eye(3)[np.argmin(np.abs(tangents[starts]), axis=1)]
    current = _normalized(cross(tangents[starts], axis))
    across[starts] = current
    order = np.argsort(-counts, kind="stable")
    starts, counts, current = starts[order], counts[order], current[order]
    for step in range(1, int(counts.max(initial=0))):
        going = int(np.searchsorted(-counts, -step))
        at = starts[:going] + step
        current = _turned(current[:going], tangents[at - 1], tangents[at])
        across[at] = current
    if closed:
        last = starts + counts - 1
        arrived = _turned(across[last], tangents[last], tangents[starts])
        sine = dot(cross(across[starts], arrived), tangents[starts])
        angle = np.arctan2(sine, dot(across[starts], arrived))
        turn = np.repeat(-angle / counts, counts)
        place = np.repeat(starts, counts) + _ramp(counts)
        turn = turn * _ramp(counts)
        v = across[place]
        side = cross(tangents[place], v)
        across[place] = np.cos(turn)[:, None] * v + np.sin(turn)[:, None] * side
    return across


def _ramp(counts: np.ndarray) -> np.ndarray:
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def _turned(v: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """v, across a, turned with the least rotation that takes a to b."""
    cosine = dot(a, b)[:, None]
    axis = cross(a, b)
    turned = (
        v * cosine + cross(axis, v) + axis * dot(axis, v)[:, None] / np.maximum(1 + cosine, 1e-12)
    )
    return _normalized(turned - b * dot(turned, b)[:, None])


def _normalized(v: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    fallback = np.broadcast_to(np.array([1.0, 0.0, 0.0]), v.shape).copy()
    return np.divide(v, length, out=fallback, where=length > 0)


def tubes(
    points: np.ndarray,
    tangents: np.ndarray,
    radii: np.ndarray,
    curve: np.ndarray,
    counts: np.ndarray,
    sides: int,
    closed: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tubes of so many sides: points and normals (n sides, 3), triangles (m, 3). Their ends are
    open. From all around they look on average as wide as round ones: a polygon's mean width is its
    perimeter / pi (Cauchy). One of 3 sides may be 9 % off, of 5 sides 3 %."""
    across = transported_frames(tangents, counts, closed)
    up = cross(tangents, across)
    # Each curve is turned by another angle (multiples of the golden ratio), so that what few sides
    # show too much or too little of evens out.
    angle = 2 * np.pi * (np.arange(sides) / sides + (curve[:, None] * GOLDEN) % 1)
    outward = np.cos(angle)[..., None] * across[:, None] + np.sin(angle)[..., None] * up[:, None]
    reach = radii * (np.pi / (sides * np.sin(np.pi / sides)))
    ring = points[:, None] + reach[:, None, None] * outward
    a, b = _segments(curve, closed)
    k = np.arange(sides)
    around = (k + 1) % sides
    p, q = a[:, None] * sides + k, a[:, None] * sides + around
    r, s = b[:, None] * sides + around, b[:, None] * sides + k
    triangles = np.stack([p, q, r, p, r, s], axis=-1).reshape(-1, 3)
    return ring.reshape(-1, 3), outward.reshape(-1, 3), triangles.astype(np.int32)


def ribbons(
    points: np.ndarray,
    tangents: np.ndarray,
    radii: np.ndarray,
    normals: np.ndarray,
    curve: np.ndarray,
    closed: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flat strips across ``normals`` (n, 3): points and normals (2 n, 3), triangles (m, 3)."""
    side = _normalized(cross(normals, tangents))
    edges = points[:, None] + radii[:, None, None] * np.stack([-side, side], axis=1)
    facing = np.repeat(_normalized(cross(tangents, side)), 2, axis=0)
    a, b = _segments(curve, closed)
    triangles = np.stack([2 * a, 2 * b, 2 * b + 1, 2 * a, 2 * b + 1, 2 * a + 1], axis=-1)
    return edges.reshape(-1, 3), facing, triangles.reshape(-1, 3).astype(np.int32)


def _segments(curve: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    _, after = neighbors(curve, closed)
    start = np.flatnonzero(after != np.arange(len(curve)))
    return start, after[start]
