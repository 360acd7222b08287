"""MaterialX pattern nodes that become textures, primvars and constants.

Only what maps onto an input of the scene description: images, geometric properties, constants and
type conversions; MaterialX's own UsdUVTexture and friends are read in ``patterns``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pxr import UsdShade

from usdmlt.scene import Input, PrimvarInput, TextureInput
from usdmlt.stage.color import DEFAULT
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
    shader = source.shader
    file = networks.source(shader, "file")
    asset = file.attribute.Get(networks.time) if file and not file.shader else None
    default = networks.read(shader, "default", 0.0 if kind == "float" else (0.0,) * 3, kind)
    if asset is None or not asset.path:
        return default
    space = DEFAULT if kind == "color" else "raw"
    if file.attribute.HasColorSpace():
        space = networks.colors.named(file.attribute.GetColorSpace(), file.attribute.GetPath())
    wrap = tuple(
        ADDRESS_MODES.get(str(networks.value(shader, f"{axis}addressmode", "periodic")), "repeat")
        for axis in "uv"
    )
    texture = networks.textures.add(file.attribute, asset, space, wrap, is_color=kind == "color")
    if texture is None:
        return default
    primvar, transform = read_texture_coordinates(networks, shader, "texcoord", unconnected="st")
    return TextureInput(
        texture=texture,
        primvar=primvar,
        channel="r" if kind == "float" else "rgb",
        transform=(_tiling(networks, shader) @ np.vstack([transform, (0.0, 0.0, 1.0)]))[:2],
    )


def _tiling(networks: Networks, shader: UsdShade.Shader) -> np.ndarray:
    """(3, 3) of ND_tiledimage: texture coordinates are ``st * uvtiling - uvoffset``."""
    tiling = networks.numbers(shader, "uvtiling", (1.0, 1.0))
    offset = networks.numbers(shader, "uvoffset", (0.0, 0.0))
    result = np.diag([*tiling, 1.0])
    result[:2, 2] = (-offset[0], -offset[1])
    return result


def read_geomprop(networks: Networks, source: Source, kind: Kind) -> Input:
    """ND_geompropvalue: a primvar of the mesh, or ``default``."""
    fallback = networks.read(source.shader, "default", 0.0 if kind == "float" else (0.0,) * 3, kind)
    name = str(networks.value(source.shader, "geomprop", ""))
    return PrimvarInput(name, fallback) if name else fallback


def read_constant(networks: Networks, source: Source, kind: Kind) -> Input | None:
    """ND_constant: its value."""
    return networks.read(source.shader, "value", None, kind)


def read_through(networks: Networks, source: Source, kind: Kind) -> Input | None:
    """Nodes that pass ``in`` on: dot, and conversions between types."""
    return networks.read(source.shader, "in", None, kind)


def read_roughness_anisotropy(networks: Networks, source: Source, kind: Kind) -> Input | None:
    """ND_roughness_anisotropy: GGX alphas of a perceptual roughness r and anisotropy a.

    MaterialX PBR specification: with q = sqrt(1 - a), alpha is (min(r² / q, 1), r² q).
    """
    roughness = networks.read(source.shader, "roughness", 0.0, "float")
    anisotropy = networks.read(source.shader, "anisotropy", 0.0, "float")
    if not isinstance(roughness, float) or not isinstance(anisotropy, float):
        networks.report.warn(
            "textures in ND_roughness_anisotropy are ignored", source.shader.GetPath()
        )
        return None
    squared = min(max(roughness**2, 1e-8), 1.0)
    if anisotropy <= 0:
        return (squared, squared)
    aspect = float(np.sqrt(1 - min(anisotropy, 0.98)))
    return (min(squared / aspect, 1.0), squared * aspect)


MATERIALX_NODES: dict[str, Callable[[Networks, Source, Kind], Input | None]] = {
    **{f"ND_image_{type}": read_image for type in TYPES},
    **{f"ND_tiledimage_{type}": read_image for type in TYPES},
    **{f"ND_constant_{type}": read_constant for type in TYPES},
    **{f"ND_geompropvalue_{type}": read_geomprop for type in TYPES},
    **{f"ND_dot_{type}": read_through for type in TYPES},
    **{f"ND_convert_{a}_{b}": read_through for a in TYPES for b in TYPES if a != b},
    "ND_roughness_anisotropy": read_roughness_anisotropy,
}
