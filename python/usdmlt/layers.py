"""The layers of a picture: their names, what they hold, and how an EXR names their channels.

A layer is asked for by a name of :data:`KNOWN`, as ``primvars:NAME``, or as a light path expression
(:mod:`usdmlt.light_path_expressions`), which may be given a name: ``caustics=LS+DE``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Union

from usdmlt.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Kind = Literal["color", "rgba", "vector3", "vector2", "uv", "scalar", "id"]
# Whose work it is: the film's samples, by their paths; the camera's rays, through the centre of a
# pixel or on average; what the render measured of itself.
Source = Literal["paths", "centre", "average", "measured"]

# Of a channel, after the layer's name and a dot; none: the layer's name is the channel's.
_SUFFIXES: dict[Kind, tuple[str, ...]] = {
    "color": ("R", "G", "B"),
    "rgba": ("R", "G", "B", "A"),
    "vector3": ("X", "Y", "Z"),
    "vector2": ("X", "Y"),
    "uv": ("U", "V"),
    "scalar": ("Y",),
    "id": (),
}
_CHANNELS_BY_NAME = {"color": ("R", "G", "B"), "alpha": ("A",), "Z": ("Z",)}
PRIMVAR_PREFIX = "primvars:"
LIGHT_GROUP_PREFIX = "lightGroup:"


@dataclass(frozen=True)
class Layer:
    """One layer, as it is asked for or as a picture has it.

    ``name``: in :attr:`usdmlt.Image.channels`. ``shows``: the light path expression,
    ``primvars:NAME``, or the name in :data:`KNOWN`. ``half``: whether a file may hold it in half
    floats.
    """

    name: str
    kind: Kind
    source: Source
    shows: str
    half: bool = False

    @property
    def primvar(self) -> str:
        """The primvar that it shows; empty: none."""
        if self.shows == "uv":
            return "st"
        is_one = self.source == "centre" and self.shows.startswith(PRIMVAR_PREFIX)
        return self.shows.removeprefix(PRIMVAR_PREFIX) if is_one else ""

    @property
    def stem(self) -> str:
        """Its name in a file, of which channels are parts: letters, digits and ``_``."""
        return re.sub(r"\W+", "_", self.name).strip("_")

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of its channels in an EXR, one for each number of a pixel."""
        if self.name in _CHANNELS_BY_NAME:
            return _CHANNELS_BY_NAME[self.name]
        return tuple(f"{self.stem}.{suffix}" for suffix in _SUFFIXES[self.kind]) or (self.stem,)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the array: uint32 for whole numbers, float32 for all else."""
        import numpy as np

        return np.dtype(np.uint32 if self.kind == "id" else np.float32)


def _known(name: str, kind: Kind, source: Source, half: bool = False) -> Layer:
    return Layer(name, kind, source, name, half)


def _paths(name: str, expression: str) -> Layer:
    return Layer(name, "color", "paths", expression, half=True)


# Every picture has the first three, "error" unless it is declined.
KNOWN: dict[str, Layer] = {
    layer.name: layer
    for layer in (
        _known("color", "color", "measured", half=True),
        _known("alpha", "scalar", "measured", half=True),
        _known("error", "scalar", "measured"),
        _known("sampleCount", "id", "measured"),
        _known("albedo", "color", "average", half=True),
        _known("CryptoObject", "rgba", "average"),
        _known("CryptoMaterial", "rgba", "average"),
        _known("N", "vector3", "centre", half=True),
        _known("Ng", "vector3", "centre", half=True),
        _known("P", "vector3", "centre"),
        _known("Z", "scalar", "centre"),
        _known("uv", "uv", "centre"),
        _known("motionvector", "vector2", "centre"),
        _known("objectId", "id", "centre"),
        _known("instanceId", "id", "centre"),
        _known("materialId", "id", "centre"),
        # One layer for each group of lights, of which those without a group are one.
        _known("lightGroups", "color", "paths", half=True),
        # emission + direct + indirect is the picture; so is emission + diffuse + specular +
        # transmission.
        _paths("emission", "C[LOB]"),
        _paths("direct", "C.[LOB]"),
        _paths("indirect", "C..+[LOB]"),
        _paths("diffuse", "C<RD>.*[LOB]"),
        _paths("specular", "C<R[GS]>.*[LOB]"),
        _paths("transmission", "C<T.>.*[LOB]"),
        _paths("caustics", "C.*<.D><.[GS]>+[LO]"),
    )
}
ALWAYS = ("color", "alpha", "error")
# Other renderers' names of the same.
ALIASES = {
    "beauty": "color",
    "Ci": "color",
    "rgb": "color",
    "RGB": "color",
    "rgba": "color",
    "RGBA": "color",
    "C": "color",
    "C.*": "color",
    "C.*[LO]": "color",
    "a": "alpha",
    "A": "alpha",
    "z": "Z",
    "depth": "Z",
    "cameraDepth": "Z",
    "normal": "N",
    "Nn": "N",
    "position": "P",
    "st": "uv",
    "motionVector": "motionvector",
    "crypto_object": "CryptoObject",
    "crypto_material": "CryptoMaterial",
    "primId": "objectId",
}

Asked = Union[str, Layer, Mapping[str, Any]]  # a mapping of its fields


def of(name: str, pixels: npt.NDArray[Any]) -> Layer:
    """What a picture's array of that name is: of :data:`KNOWN`, else as its shape says."""
    if name in KNOWN:
        return KNOWN[name]
    if pixels.dtype.kind == "u":
        return Layer(name, "id", "centre", name)
    width = 1 if pixels.ndim == 2 else pixels.shape[2]
    kinds: dict[int, Kind] = {1: "scalar", 2: "vector2", 3: "color", 4: "rgba"}
    return Layer(name, kinds[width], "measured", name)


def split(text: str) -> list[str]:
    """The parts of ``NAME,NAME``: commas in brackets and quotes belong to an expression."""
    parts, depth, quoted = [""], 0, False
    for character in text:
        quoted ^= character == "'"
        depth += 0 if quoted else (character in "([<{") - (character in ")]>}")
        if character == "," and depth == 0 and not quoted:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def parse(asked: Asked) -> Layer:
    """The layer that ``NAME``, ``primvars:NAME``, ``EXPRESSION`` or ``NAME=EXPRESSION`` asks for.

    Raises ValueError for a name that is none, and for an expression with an error in it, which is
    pointed at.
    """
    if isinstance(asked, Layer):
        return asked
    if isinstance(asked, Mapping):
        return Layer(**asked)
    if not isinstance(asked, str) or not asked:
        raise UsageError(f"a layer is asked for by its name, not by {asked!r}")
    known = KNOWN.get(ALIASES.get(asked, asked))
    if known is not None:
        return known
    if asked.startswith(PRIMVAR_PREFIX):
        return primvar(asked.removeprefix(PRIMVAR_PREFIX))
    if asked.startswith(LIGHT_GROUP_PREFIX):
        return light_group(asked.removeprefix(LIGHT_GROUP_PREFIX))
    name, equals, expression = asked.partition("=")
    if not equals:
        is_word = re.fullmatch(r"\w*[a-z]\w*", asked)
        if is_word or not re.match(r"C|L.*E$", asked):
            raise UsageError(
                f"unknown layer {asked!r}: the layers are {', '.join(KNOWN)}, primvars:NAME, "
                "lightGroup:NAME and light path expressions, C... or L...E"
            )
        return light_paths(asked, asked)
    if not re.fullmatch(r"[A-Za-z_]\w*", name):
        raise UsageError(f"{name!r} in {asked!r} is no name for a layer")
    return light_paths(name, expression)


def primvar(name: str) -> Layer:
    """The layer of a primvar. How many numbers it has is known when the stage is read."""
    if not name:
        raise UsageError("primvars: has to be followed by the name of a primvar")
    return Layer(PRIMVAR_PREFIX + name, "scalar", "centre", PRIMVAR_PREFIX + name)


def light_paths(name: str, expression: str) -> Layer:
    """The layer of a light path expression; ValueError where there is an error in it."""
    from usdmlt import light_path_expressions

    light_path_expressions.parse(expression)
    return _paths(name, expression)


def light_group(group: str) -> Layer:
    """The layer of the lights of one group."""
    if not group or "'" in group:
        raise UsageError(f"{group!r} is no name of a light group")
    return _paths(LIGHT_GROUP_PREFIX + group, f"C.*<[LOB].'{group}'>")


def resolve(asked: Iterable[Asked]) -> tuple[Layer, ...]:
    """All layers that are asked for, but for those that every picture has. A string may name
    several.

    Raises ValueError for one that is asked for twice, or that a file could not tell from another.
    """
    layers: dict[str, Layer] = {}
    if isinstance(asked, str):
        asked = split(asked)
    for one in asked:
        layer = parse(one)
        other = layers.get(layer.stem)
        if other is not None:
            names = layer.name if other == layer else f"{other.name}, {layer.name}"
            raise UsageError(f"two layers of one name are asked for: {names}")
        layers[layer.stem] = layer
    return tuple(layer for layer in layers.values() if layer.name not in ALWAYS)


def of_width(layer: Layer, width: int, is_color: bool) -> Layer:
    """The layer of a primvar of so many numbers, which may be a colour."""
    kinds: Sequence[Kind] = ("scalar", "vector2", "color" if is_color else "vector3", "rgba")
    return replace(layer, kind=kinds[width - 1])
