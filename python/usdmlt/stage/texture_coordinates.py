"""Where texture nodes look: the primvar they read, and its affine transform."""

from __future__ import annotations

import numpy as np
from pxr import UsdShade

from usdmlt.scene import Input, PrimvarInput
from usdmlt.stage.materialx_nodes import reader as computing_node
from usdmlt.stage.networks import Networks, Unusable


def read_texture_coordinates(
    networks: Networks, shader: UsdShade.Shader, name: str, unconnected: str = ""
) -> tuple[str, np.ndarray, Input | None]:
    """The primvar that an input such as ``st`` reads, and the (2, 3) transform applied to it; or,
    last, the input that other nodes make in the primvar's place.

    ``unconnected``: the primvar of an input without connection; "" for one fixed point of the
    texture, (0, 0) unless authored, as UsdUVTexture has it.
    """
    transform = np.eye(3)
    visited = set()
    while True:
        if shader.GetPath() in visited:
            raise Unusable("shading networks go round in a circle", shader.GetPath())
        visited.add(shader.GetPath())
        source = networks.source(shader, name)
        if source is None or source.shader is None:
            if source is None and unconnected:
                return unconnected, transform[:2].copy(), None
            point = (0.0, 0.0)
            if source is not None:
                point = networks.constant(source.attribute, point, "float2")
            fixed = np.array([[0.0, 0.0, point[0]], [0.0, 0.0, point[1]], [0.0, 0.0, 1.0]])
            return "", (transform @ fixed)[:2], None

        node, consumer, shader = source.node.removeprefix("ND_"), shader, source.shader
        if node == "UsdTransform2d":
            transform = transform @ transform_2d(networks, shader)
            name = "in"
            continue
        if node.startswith("UsdPrimvarReader_"):
            primvar = networks.value(shader, "varname", "") or "st"
            fallback = networks.numbers(shader, "fallback", (0.0, 0.0))
            if fallback != (0.0, 0.0):
                made = PrimvarInput(str(primvar), (*fallback, 0.0))
                return str(primvar), transform[:2].copy(), made
        elif node.startswith("geompropvalue_"):
            primvar = networks.value(shader, "geomprop", "") or "st"
        else:
            primvar = "st"
            if computing_node(source.node) and not node.startswith("texcoord_"):
                made = networks.read(consumer, name, (0.0, 0.0), "value")
                return "", transform[:2].copy(), made
            if not node.startswith("texcoord_"):
                networks.report.warn(
                    f"texture coordinates from {node or 'unknown nodes'} are read from st",
                    shader.GetPath(),
                )
        return str(primvar), transform[:2].copy(), None


def transform_2d(networks: Networks, shader: UsdShade.Shader) -> np.ndarray:
    """UsdTransform2d as a 3x3 matrix: scale, then rotate counter-clockwise, then translate."""
    scale = networks.numbers(shader, "scale", (1.0, 1.0))
    translation = networks.numbers(shader, "translation", (0.0, 0.0))
    angle = np.radians(networks.number(shader, "rotation", 0.0))
    c, s = np.cos(angle), np.sin(angle)
    linear = np.array([[c, -s], [s, c]]) @ np.diag(scale)
    result = np.eye(3)
    result[:2, :2] = linear
    result[:2, 2] = translation
    return result
