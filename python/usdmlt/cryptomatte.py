"""Cryptomatte 1.2: which objects a pixel shows, and how much of each, for compositors to pick.

An object is the hash of its name, written as a float (Friedman & Jones 2015, "Fully Automatic ID
Mattes with Support for Motion Blur and Transparency"; github.com/Psyop/Cryptomatte, specification).
Layers NAME00, NAME01 ... hold two pairs (id, coverage) each, the largest first.
"""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

RANKS = 6  # pairs by pixel


def murmur3(text: str) -> int:
    """MurmurHash3_x86_32 of the UTF-8 bytes, seed 0 (Austin Appleby, public domain)."""
    mask, data = 0xFFFFFFFF, text.encode()

    def rotated(x: int, bits: int) -> int:
        return (x << bits | x >> (32 - bits)) & mask

    def mixed(block: int) -> int:
        return rotated(block * 0xCC9E2D51 & mask, 15) * 0x1B873593 & mask

    h, whole = 0, len(data) // 4 * 4
    for i in range(0, whole, 4):
        h ^= mixed(int.from_bytes(data[i : i + 4], "little"))
        h = (rotated(h, 13) * 5 + 0xE6546B64) & mask
    if whole < len(data):
        h ^= mixed(int.from_bytes(data[whole:], "little"))
    h ^= len(data)
    h = (h ^ h >> 16) * 0x85EBCA6B & mask
    h = (h ^ h >> 13) * 0xC2B2AE35 & mask
    return h ^ h >> 16


def identifier(name: str) -> int:
    """The bits of a name's id: its hash, but for exponents that no ordinary float has."""
    bits = murmur3(name)
    return bits ^ (1 << 23) if (bits >> 23 & 255) in (0, 255) else bits


def layers(
    name: str,
    numbers: npt.NDArray[np.int32],
    coverage: npt.NDArray[np.float32],
    names_of: Callable[[npt.NDArray[np.int64]], list[str]],
) -> tuple[dict[str, npt.NDArray[np.float32]], dict[str, str]]:
    """The layers of a Cryptomatte called ``name``, and its metadata.

    ``numbers`` (height, width, :data:`RANKS`): of objects, -1 for none; ``coverage``: of the same
    shape; ``names_of``: some of the numbers. What has the same name is one.
    """
    seen = np.flatnonzero(np.bincount(numbers.ravel() + 1)[1:])
    manifest = {called: identifier(called) for called in names_of(seen)}
    bits = np.zeros(int(seen.max(initial=-1)) + 2, np.uint32)  # the last is that of -1
    bits[seen] = [manifest[called] for called in names_of(seen)]
    ids, coverage = _merged(bits[numbers], np.where(numbers < 0, 0, coverage).astype(np.float32))
    pairs = np.stack([ids.view(np.float32), coverage], axis=-1)
    pixels = {
        f"{name}{i:02}": np.ascontiguousarray(pairs[:, :, 2 * i : 2 * i + 2]).reshape(
            *numbers.shape[:2], 4
        )
        for i in range(RANKS // 2)
    }
    prefix = f"cryptomatte/{identifier(name):08x}"[: len("cryptomatte/") + 7]
    return pixels, {
        f"{prefix}/name": name,
        f"{prefix}/hash": "MurmurHash3_32",
        f"{prefix}/conversion": "uint32_to_float32",
        f"{prefix}/manifest": json.dumps(
            {key: f"{value:08x}" for key, value in manifest.items()}, ensure_ascii=False
        ),
    }


def _merged(
    ids: npt.NDArray[np.uint32], coverage: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Equal ids of a pixel as one, the largest first; where there is no coverage there is no id."""
    for later in range(1, ids.shape[-1]):
        for earlier in range(later):
            same = ids[..., later] == ids[..., earlier]
            coverage[..., earlier] += np.where(same, coverage[..., later], 0)
            coverage[..., later] = np.where(same, 0, coverage[..., later])
    ids = np.where(coverage > 0, ids, 0).astype(np.uint32)
    order = np.argsort(-coverage, axis=-1, kind="stable")
    return np.take_along_axis(ids, order, -1), np.take_along_axis(coverage, order, -1)
