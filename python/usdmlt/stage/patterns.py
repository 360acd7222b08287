"""The nodes that feed material inputs: UsdUVTexture, UsdPrimvarReader, UsdTransform2d.

A reader takes (networks, source, kind) and returns an input of the scene description, or None
where the consumer's default applies.
"""

from __future__ import annotations

from collections.abc import Callable

from pxr import UsdShade

from usdmlt.scene import Input, PrimvarInput, TextureInput
from usdmlt.stage.materialx_nodes import reader as computing_node
from usdmlt.stage.materialx_patterns import MATERIALX_NODES
from usdmlt.stage.networks import Kind, Networks, Source
from usdmlt.stage.texture_coordinates import read_texture_coordinates

CHANNELS = ("rgb", "r", "g", "b", "a")


def read_uv_texture(networks: Networks, source: Source, kind: Kind) -> Input:
    """UsdUVTexture: ``texel * scale + bias``, or ``fallback`` where the file cannot be read."""
    shader = source.shader
    channel = source.output if source.output in CHANNELS else "rgb"
    if kind == "float" and channel == "rgb":
        channel = "r"
    fallback = networks.numbers(shader, "fallback", (0.0, 0.0, 0.0, 1.0))
    file = networks.source(shader, "file")
    asset = file.attribute.Get(networks.time) if file and not file.shader else None
    # MaterialX's definition of the node repeats the image; USD's asks the file, or shows black.
    unwrapped = "periodic" if source.node.startswith("ND_") else "useMetadata"
    texture = None
    if asset is not None and asset.path:
        texture = networks.textures.add(
            file.attribute,
            asset,
            _declared_space(networks, shader, file),
            tuple(str(networks.value(shader, f"wrap{axis}", unwrapped)) for axis in "ST"),
            is_color=kind == "color" or (kind == "value" and channel == "rgb"),
        )
    if texture is None:
        return _fallback(fallback, channel, kind)
    primvar, transform, coordinates = read_texture_coordinates(networks, shader, "st")
    return TextureInput(
        texture=texture,
        primvar=primvar,
        coordinates=coordinates,
        channel=channel,
        scale=networks.numbers(shader, "scale", (1.0,) * 4),
        bias=networks.numbers(shader, "bias", (0.0,) * 4),
        fallback=fallback,
        transform=transform,
    )


def _fallback(fallback: tuple[float, ...], channel: str, kind: Kind) -> Input:
    """The constant that stands for a texture that cannot be read."""
    values = fallback[:3] if channel == "rgb" else (fallback["rgba".index(channel)],) * 3
    return values[0] if kind == "float" else values


def _declared_space(networks: Networks, shader: UsdShade.Shader, file: Source) -> str | None:
    """The colour space a texture node declares, or None for the "auto" rule.

    ``sourceColorSpace`` comes first where it is authored as sRGB or raw; then the colour space
    of ``inputs:file``, which newer files use instead.
    """
    declared = str(networks.value(shader, "sourceColorSpace", "auto"))
    if declared in ("raw", "sRGB"):
        return networks.colors.named(declared, shader.GetPath())
    if file.attribute.HasColorSpace():
        name = file.attribute.GetColorSpace()
        if name and name.lower() != "auto":
            return networks.colors.declared(name, file.attribute)
    return None


def read_primvar_node(networks: Networks, source: Source, kind: Kind) -> Input | None:
    """UsdPrimvarReader_*: the mesh's primvar, or ``fallback`` where it has none."""
    name = str(networks.value(source.shader, "varname", ""))
    fallback = networks.read(
        source.shader, "fallback", 0.0 if kind == "float" else (0.0,) * 3, kind
    )
    if not name:
        return fallback
    return PrimvarInput(name, fallback)


def node_reader(node: str) -> Callable[[Networks, Source, Kind], Input | None] | None:
    """What reads a node of this identifier; None if nothing does."""
    return NODES.get(node) or computing_node(node)


NODES: dict[str, Callable[[Networks, Source, Kind], Input | None]] = {
    "UsdUVTexture": read_uv_texture,
    **{
        f"UsdPrimvarReader_{kind}": read_primvar_node
        for kind in ("float", "float2", "float3", "float4", "int", "normal", "point", "vector")
    },
    "ND_UsdUVTexture": read_uv_texture,
    "ND_UsdUVTexture_22": read_uv_texture,
    "ND_UsdUVTexture_23": read_uv_texture,
    **{
        f"ND_UsdPrimvarReader_{kind}": read_primvar_node
        for kind in ("float", "integer", "vector2", "vector3", "vector4")
    },
    **MATERIALX_NODES,
}
