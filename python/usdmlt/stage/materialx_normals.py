"""Normal maps of MaterialX surfaces: what feeds an input of type "normal"."""

from __future__ import annotations

from pxr import UsdShade

from usdmlt.scene import Input, Node, TextureInput
from usdmlt.stage.expressions import is_constant, operate, plain
from usdmlt.stage.networks import Networks, Source


def read_normal(
    networks: Networks, shader: UsdShade.Shader, name: str
) -> TextureInput | Node | None:
    """The tangent-space normal that feeds an input, in [-1, 1]; None where it is the surface's."""
    source = networks.source(shader, name)
    if source is None or source.shader is None:
        return None
    if source.node.startswith("ND_normalmap"):
        return _decoded(networks, source)
    if not source.node.startswith("ND_normal_"):
        networks.report.warn(
            f"normals from {source.node or 'unknown nodes'} are not rendered", shader.GetPath()
        )
    return None


def _decoded(networks: Networks, source: Source) -> TextureInput | Node | None:
    """ND_normalmap: a normal stored as (n + 1) / 2, its x and y scaled."""
    stored = networks.read(source.shader, "in", None, "data")
    if stored is None or is_constant(stored):
        return None
    strength = networks.read(source.shader, "scale", 1.0, "value")
    if isinstance(stored, TextureInput) and is_constant(strength):
        x, y = (plain(strength),) * 2 if not isinstance(strength, tuple) else strength[:2]
        if stored.scale == (1.0,) * 4 and stored.bias == (0.0,) * 4:
            stored.scale, stored.bias = (2 * x, 2 * y, 2.0, 1.0), (-x, -y, -1.0, 0.0)
            return stored
    centred: Input = operate("subtract", operate("multiply", stored, 2.0), 1.0)
    lanes = [operate("extract", strength, width=1, data=i) for i in (0, 1)]
    return operate("multiply", centred, operate("combine3", *lanes, 1.0))
