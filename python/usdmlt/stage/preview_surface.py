"""UsdPreviewSurface into a closure, a coverage, a normal map and a displacement."""

from __future__ import annotations

from pxr import UsdShade

from usdmlt.scene import Material, Node, PreviewSurface, TextureInput
from usdmlt.stage.networks import Networks

COLORS = {
    "diffuseColor": (0.18, 0.18, 0.18),
    "emissiveColor": (0.0, 0.0, 0.0),
    "specularColor": (0.0, 0.0, 0.0),
}
FLOATS = {
    "metallic": 0.0,
    "roughness": 0.5,
    "clearcoat": 0.0,
    "clearcoatRoughness": 0.01,
    "ior": 1.5,
}
PRESENCE = ("presence", "1")  # MaterialX's node counts the modes


def read_preview_surface(networks: Networks, shader: UsdShade.Shader) -> Material:
    """The material of a UsdPreviewSurface node.

    Opacity: with a threshold it is a cut-out, in mode "presence" a coverage of everything; in
    mode "transparent" (the default, and what files without the mode mean) what is not opaque
    refracts by ``ior``, as MaterialX and RenderMan render it.
    """
    closure = PreviewSurface(
        useSpecularWorkflow=int(networks.number(shader, "useSpecularWorkflow", 0)),
        **{name: networks.read(shader, name, default, "color") for name, default in COLORS.items()},
        **{name: networks.read(shader, name, default, "float") for name, default in FLOATS.items()},
    )
    material = Material(closure, normal=_normal(networks, shader))
    opacity = networks.read(shader, "opacity", 1.0, "float")
    threshold = networks.number(shader, "opacityThreshold", 0.0)
    if threshold > 0:
        material.opacity, material.opacity_threshold = opacity, threshold
    elif str(networks.value(shader, "opacityMode", "transparent")) in PRESENCE:
        material.opacity = opacity
    else:
        closure.opacity = opacity
    material.displacement = networks.read(shader, "displacement", 0.0, "float")
    return material


def _normal(networks: Networks, shader: UsdShade.Shader) -> TextureInput | Node | None:
    """The normal map, if there is one; a constant normal is that of the surface."""
    value = networks.read(shader, "normal", None, "data")
    if isinstance(value, (TextureInput, Node)):
        return value
    source = networks.source(shader, "normal")
    if source is not None and source.shader is None and value not in (None, (0.0, 0.0, 1.0)):
        networks.report.warn(
            "normals that are neither textured nor (0, 0, 1) are ignored", shader.GetPath()
        )
    return None
