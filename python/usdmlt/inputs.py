"""What the inputs of materials are: numbers, textures, primvars, and operations on them.

Part of :mod:`usdmlt.scene`, which has all of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, Union

import numpy as np

Color = tuple[float, float, float]


@dataclass
class Texture:
    """An image, as it is stored, and how it becomes linear in the rendering colour space.

    ``pixels``: (height, width, channels) uint8, uint16, float16 or float32, 1 to 4 channels, row 0
    on top; the core keeps the array without copying it. Integers are fractions of the largest, or,
    for colours, ``decode[stored]`` (256 or 65536 floats). ``matrix`` (3, 3) takes the linear
    colour to the rendering space. Alpha (the second of two channels, the fourth of four) is as it
    is stored.
    """

    pixels: np.ndarray
    wrap_s: Literal["black", "clamp", "repeat", "mirror"] = "repeat"
    wrap_t: Literal["black", "clamp", "repeat", "mirror"] = "repeat"
    name: str = ""
    decode: np.ndarray | None = None
    matrix: np.ndarray | None = None

    def linear(self) -> np.ndarray:
        """All pixels as lookups see them: (height, width, channels) float32."""
        colors = 1 if self.pixels.shape[2] < 3 else 3
        result = self.pixels.astype(np.float32)
        if self.pixels.dtype.kind == "u":
            result /= np.iinfo(self.pixels.dtype).max
            if self.decode is not None:
                result[..., :colors] = self.decode[self.pixels[..., :colors]]
        if self.matrix is not None and colors == 3:
            result[..., :3] = result[..., :3] @ np.asarray(self.matrix, np.float32).T
        return result


@dataclass
class TextureInput:
    """A material input read from a texture: ``(texel * scale + bias)[channel]``.

    ``texture`` indexes :attr:`Scene.textures`; a dict is a UDIM set, by the numbers of its tiles,
    black and transparent where there is none; None (an unreadable file) gives ``fallback``.
    ``transform`` (2, 3) maps the primvar's (s, t) to texture coordinates: ``A @ (s, t, 1)``.
    ``coordinates``: an input that gives (s, t) in the primvar's place.
    Channels a texture lacks: one channel is grey with alpha 1; two are grey and alpha; three have
    alpha 1. A mesh without the primvar is sampled as if it were (0, 0) everywhere.
    """

    texture: int | dict[int, int] | None
    primvar: str = "st"
    channel: Literal["rgb", "r", "g", "b", "a"] = "rgb"
    scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    bias: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    fallback: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    transform: np.ndarray = field(
        default_factory=lambda: np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    )
    coordinates: Input | None = None


@dataclass
class PrimvarInput:
    """A material input read from a primvar of the mesh; ``fallback`` where the mesh lacks it."""

    primvar: str
    fallback: float | Color = 0.0


@dataclass(eq=False)
class Node:
    """A pattern node: an operation of the core on other inputs.

    ``operation``: one of the core's table (cpp/materials/nodes.cpp), which says what ``data`` is.
    Inputs may also be vectors of two and four numbers here. ``width``: how many numbers the result
    has; where it is 1 they are all the same.
    """

    operation: str
    inputs: tuple[Any, ...] = ()
    width: int = 3
    data: int = 0


INPUT_NODES = (TextureInput, PrimvarInput, Node)
Input = Union[float, Color, TextureInput, PrimvarInput, Node]
