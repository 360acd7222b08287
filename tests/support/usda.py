"""Pieces of stages as text. The `write` fixture puts QUAD into bodies by its name."""

from __future__ import annotations

QUAD = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
"""
# From -1 to 1, with outward faces.
CUBE = """
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4,
                               2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
    point3f[] points = [(-1, -1, -1), (1, -1, -1), (-1, 1, -1), (1, 1, -1),
                        (-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1)]
"""


def mtlx_material(nodes: str = "", surface: str = "", kind: str = "ND_surface") -> str:
    """The material /M: a surface shader of a ``kind`` with inputs, and the nodes that feed it."""
    return f"""
def Material "M" {{
    token outputs:mtlx:surface.connect = </M/surface.outputs:out>
    {node("surface", kind, surface)}
    {nodes}
}}
"""


def node(name: str, kind: str, inputs: str = "") -> str:
    """A node of the material /M."""
    return f"""def Shader "{name}" {{
        uniform token info:id = "{kind}"
        {inputs}
        token outputs:out
    }}
    """


def connect(name: str, other: str, type_name: str = "token") -> str:
    """An input that another node of the material /M feeds."""
    return f"{type_name} inputs:{name}.connect = </M/{other}.outputs:out>\n"


def instance(name: str, of: str = "/asset") -> str:
    """A native instance."""
    return f"""def Xform "{name}" (
        instanceable = true
        references = <{of}>
    ) {{}}"""
