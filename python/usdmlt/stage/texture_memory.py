"""A limit on what the textures of a scene take."""

from __future__ import annotations

import numpy as np

from usdmlt.errors import Report
from usdmlt.scene import Texture

MEBIBYTE = 2**20


def limit_textures(textures: list[Texture], limit: float | None, report: Report) -> None:
    """Halve the sides of the largest textures until all of them take at most ``limit`` MiB.

    Textures that share their pixels are one. None: no limit. Every texture that was made smaller is
    named in one note; a texel is the smallest there is.
    """
    if limit is None:
        return
    while sum(_distinct(textures).values()) > limit * MEBIBYTE:
        sizes = _distinct(textures)
        largest = max(sizes, key=lambda key: sizes[key])
        sharing = [texture for texture in textures if id(texture.pixels) == largest]
        pixels = sharing[0].pixels
        if pixels.shape[0] * pixels.shape[1] == 1:
            return
        smaller = halved(pixels, sharing[0].decode)
        for texture in sharing:
            texture.pixels = smaller
            report.note("textures are smaller than authored, to fit the memory limit", texture.name)


def _distinct(textures: list[Texture]) -> dict[int, int]:
    """Bytes of every array of pixels by its id."""
    return {id(texture.pixels): texture.pixels.nbytes for texture in textures}


def halved(pixels: np.ndarray, decode: np.ndarray | None = None) -> np.ndarray:
    """Half as many rows and columns (at least one): means of 2 x 2 texels, of the same type.

    ``decode``: as of a :class:`usdmlt.scene.Texture`; the means are those of the linear colours.
    An odd row or column at the end goes to its neighbours.
    """
    colors = 1 if pixels.shape[2] < 3 else 3
    linear = pixels.astype(np.float32)
    if decode is not None:
        linear[..., :colors] = decode[pixels[..., :colors]]
    for axis in (0, 1):
        count = linear.shape[axis]
        if count == 1:
            continue
        # Edges of the new texels between the old ones; a sum over each by reduceat.
        edges = np.arange(count // 2) * count // (count // 2)
        sizes = np.diff(np.append(edges, count))
        shape = [1, 1, 1]
        shape[axis] = -1
        linear = np.add.reduceat(linear, edges, axis=axis)
        linear /= sizes.reshape(shape).astype(np.float32)
    if pixels.dtype.kind != "u":
        return np.ascontiguousarray(linear, dtype=pixels.dtype)
    stored = np.rint(linear)
    if decode is not None:  # the nearest of the table, which ascends
        between = (decode[1:] + decode[:-1]) / 2
        stored[..., :colors] = np.searchsorted(between, linear[..., :colors])
    return stored.astype(pixels.dtype)
