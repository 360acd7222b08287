"""MaterialX pattern nodes that become textures and primvars, and the roughness of GGX lobes.

Nodes that compute are in ``materialx_nodes``; MaterialX's own UsdUVTexture and friends are read in
``patterns``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pxr import UsdShade

from usdmlt.scene import Input, PrimvarInput, TextureInput
from usdmlt.stage.color import DEFAULT
from usdmlt.stage.expressions import (
    clamp,
    divide,
    is_constant,
    lane,
    multiply,
    operate,
    plain,
    power,
    subtract,
)
from usdmlt.stage.networks import Kind, Networks, Source
from usdmlt.stage.texture_coordinates import read_texture_coordinates

TYPES = ("float", "color3", "color4", "vector2", "vector3", "vector4")
ADDRESS_MODES = {
    "constant": "black",
    "clamp": "clamp",
    "periodic": "repeat",
    "mirror": "mirror",
}


def read_image(networks: Networks, source: Source, kind: Kind) -> Input | None:
    """ND_image and ND_tiledimage. Colours without a colour space are linear Rec.709 (MaterialX:
    untagged values are in the working space)."""
    shader, type = source.shader, source.node.rsplit("_", 1)[-1]
    kind = "float" if type == "float" else "color" if type.startswith("color") else "data"
    file = networks.source(shader, "file")
    asset = file.attribute.Get(networks.time) if file and not file.shader else None
    default = networks.read(shader, "default", 0.0 if kind == "float" else (0.0,) * 3, kind)
    if asset is None or not asset.path:
        return default
    space = DEFAULT if kind == "color" else "raw"
    if file.attribute.HasColorSpace():
        space = networks.colors.declared(file.attribute.GetColorSpace(), file.attribute)
    wrap = tuple(
        ADDRESS_MODES.get(str(networks.value(shader, f"{axis}addressmode", "periodic")), "repeat")
        for axis in "uv"
    )
    texture = networks.textures.add(file.attribute, asset, space, wrap, is_color=kind == "color")
    if texture is None:
        return default
    primvar, transform, coordinates = read_texture_coordinates(
        networks, shader, "texcoord", unconnected="st"
    )
    return TextureInput(
        texture=texture,
        primvar=primvar,
        coordinates=coordinates,
        channel="r" if kind == "float" else "rgb",
        transform=(_tiling(networks, shader) @ np.vstack([transform, (0.0, 0.0, 1.0)]))[:2],
    )


def _tiling(networks: Networks, shader: UsdShade.Shader) -> np.ndarray:
    """(3, 3) of ND_tiledimage: texture coordinates are ``st * uvtiling - uvoffset``, that times
    realworldtilesize / realworldimagesize."""
    tiling = networks.numbers(shader, "uvtiling", (1.0, 1.0))
    offset = networks.numbers(shader, "uvoffset", (0.0, 0.0))
    image = networks.numbers(shader, "realworldimagesize", (1.0, 1.0))
    tile = networks.numbers(shader, "realworldtilesize", (1.0, 1.0))
    size = np.array([t / i if i else 1.0 for t, i in zip(tile, image, strict=True)])
    result = np.diag([*(size * tiling), 1.0])
    result[:2, 2] = -size * offset
    return result


def read_geomprop(networks: Networks, source: Source, kind: Kind) -> Input:
    """ND_geompropvalue: a primvar of the mesh, or ``default``."""
    fallback = networks.read(source.shader, "default", 0.0 if kind == "float" else (0.0,) * 3, kind)
    name = str(networks.value(source.shader, "geomprop", ""))
    return PrimvarInput(name, fallback) if name else fallback


def ggx_alphas(roughness: Input, anisotropy: Input) -> Input | tuple[Input, Input]:
    """GGX alphas of a perceptual roughness r and an anisotropy a; one where a is 0.

    MaterialX's ND_roughness_anisotropy: with q = sqrt(1 - a), alpha is (min(r² / q, 1), r² q).
    """
    squared = clamp(power(roughness, 2.0), 1e-8, 1.0)
    if is_constant(anisotropy) and plain(anisotropy) <= 0:
        return squared
    aspect = operate("sqrt", subtract(1.0, clamp(anisotropy, 0.0, 0.98)), width=1)
    return operate("min", divide(squared, aspect), 1.0, width=1), multiply(squared, aspect)


def read_roughness_anisotropy(networks: Networks, source: Source, kind: Kind) -> Input | None:
    """ND_roughness_anisotropy, as a vector of two."""
    alphas = ggx_alphas(
        networks.read(source.shader, "roughness", 0.0, "float"),
        networks.read(source.shader, "anisotropy", 0.0, "float"),
    )
    return as_vector(*(alphas if isinstance(alphas, tuple) else (alphas, alphas)))


def read_roughness_dual(networks: Networks, source: Source, kind: Kind) -> Input | None:
    """ND_roughness_dual: squares of two roughnesses; a negative second is the first."""
    both = networks.read(source.shader, "roughness", (0.0, -1.0), "value")
    x, y = lane(both, 0), lane(both, 1)
    if is_constant(both):
        y = x if plain(y) < 0 else y
    else:
        y = operate("if_greater", 0.0, y, x, y, width=1)
    return as_vector(*(clamp(power(v, 2.0), 1e-8, 1.0) for v in (x, y)))


def as_vector(x: Input, y: Input) -> Input:
    """Two numbers as one input."""
    if is_constant(x) and is_constant(y):
        return (plain(x), plain(y))
    return operate("combine2", x, y, width=2)


MATERIALX_NODES: dict[str, Callable[[Networks, Source, Kind], Input | None]] = {
    **{f"ND_image_{type}": read_image for type in TYPES},
    **{f"ND_tiledimage_{type}": read_image for type in TYPES},
    **{f"ND_geompropvalue_{type}": read_geomprop for type in (*TYPES, "integer", "boolean")},
    "ND_roughness_anisotropy": read_roughness_anisotropy,
    "ND_roughness_dual": read_roughness_dual,
}
