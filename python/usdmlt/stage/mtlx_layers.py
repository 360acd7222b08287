"""A MaterialX document as a USD layer, in the layout of OpenUSD's usdMtlx.

    /MaterialX/Materials/<material>             Material, outputs:mtlx:surface
    /MaterialX/Materials/<material>/<node>      Shader; node graphs are resolved into their nodes

Nodes that the renderer does not know, but that MaterialX implements by a graph of other nodes, are
replaced by that graph.
"""

from __future__ import annotations

import os
from functools import cache
from typing import Any

from pxr import Ar, Sdf, Tf

TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "integer": Sdf.ValueTypeNames.Int,
    "boolean": Sdf.ValueTypeNames.Bool,
    "color3": Sdf.ValueTypeNames.Color3f,
    "color4": Sdf.ValueTypeNames.Color4f,
    "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3,
    "vector4": Sdf.ValueTypeNames.Float4,
    "string": Sdf.ValueTypeNames.String,
    "filename": Sdf.ValueTypeNames.Asset,
}
MATERIALS = "/MaterialX/Materials"


class UnreadableDocument(Exception):
    """A MaterialX file that cannot be read; the message says why."""


def read_layer(path: str) -> Sdf.Layer:
    """A layer with the materials of a .mtlx file. Raises :class:`UnreadableDocument`."""
    document = _read_document(path)
    layer = Sdf.Layer.CreateAnonymous(os.path.basename(path) + ".usda")
    root = Sdf.CreatePrimInLayer(layer, "/MaterialX")
    root.specifier, layer.defaultPrim = Sdf.SpecifierDef, "MaterialX"
    scope = Sdf.CreatePrimInLayer(layer, MATERIALS)
    scope.specifier = Sdf.SpecifierDef
    folder = os.path.dirname(path)
    for material in document.getMaterialNodes():
        _Writer(layer, folder).material(material)
    return layer


def _read_document(path: str) -> Any:
    import MaterialX as mx

    document = mx.createDocument()
    try:
        text = _text(path)
        mx.readFromXmlString(document, text, mx.FileSearchPath(os.path.dirname(path)))
        document.setDataLibrary(_library())
        for graph in [document, *document.getNodeGraphs()]:
            if graph is document or graph.getNodeDef() is None:
                graph.flattenSubgraphs("", _is_replaced)
    except Exception as error:  # the bindings raise many kinds
        reason = str(error).strip().splitlines()
        raise UnreadableDocument(f"{path}: {reason[0] if reason else 'no reason'}") from None
    return document


@cache
def _library() -> Any:
    """The definitions of all standard nodes, read once."""
    import MaterialX as mx

    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    return library


def _text(path: str) -> str:
    """The file, through USD's resolver: it may be inside a package."""
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise FileNotFoundError("no such file")
    return bytes(asset.GetBuffer()).decode("utf-8")


def _is_replaced(node: Any) -> bool:
    """Whether the renderer knows no such node and has to see what it is made of."""
    from usdmlt.stage.materials import SURFACES
    from usdmlt.stage.materialx import CLOSURES
    from usdmlt.stage.patterns import node_reader

    definition = node.getNodeDef()
    if definition is None or node.getCategory().endswith("material"):
        return False
    name = definition.getName()
    known = name in SURFACES or name in CLOSURES or name.startswith("ND_normalmap")
    return not known and node_reader(name) is None


class _Writer:
    """Writes one material and the nodes that it reaches."""

    def __init__(self, layer: Sdf.Layer, folder: str):
        self.layer = layer
        self.folder = folder
        self.nodes: dict[str, Sdf.PrimSpec] = {}

    def material(self, material: Any) -> None:
        self.path = f"{MATERIALS}/{Tf.MakeValidIdentifier(material.getName())}"
        prim = Sdf.CreatePrimInLayer(self.layer, self.path)
        prim.specifier, prim.typeName = Sdf.SpecifierDef, "Material"
        surface = material.getInput("surfaceshader")
        node = surface.getConnectedNode() if surface is not None else None
        if node is None:
            return
        output = Sdf.AttributeSpec(prim, "outputs:mtlx:surface", Sdf.ValueTypeNames.Token)
        output.connectionPathList.explicitItems = [self.output(node, "out")]

    def output(self, node: Any, name: str) -> Sdf.Path:
        """The output of a node, which is written unless it is there."""
        key = node.getNamePath()
        if key not in self.nodes:
            self.node(key, node)
        prim = self.nodes[key]
        attribute = f"outputs:{name or 'out'}"
        if attribute not in prim.attributes:
            Sdf.AttributeSpec(prim, attribute, TYPES.get(node.getType(), Sdf.ValueTypeNames.Token))
        return prim.path.AppendProperty(attribute)

    def node(self, key: str, node: Any) -> None:
        definition = node.getNodeDef()
        name = Tf.MakeValidIdentifier(key.replace("/", "_"))
        prim = Sdf.CreatePrimInLayer(self.layer, f"{self.path}/{name}")
        prim.specifier, prim.typeName = Sdf.SpecifierDef, "Shader"
        self.nodes[key] = prim
        identifier = Sdf.AttributeSpec(
            prim, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform
        )
        identifier.default = definition.getName() if definition else f"ND_{node.getCategory()}"
        for source in node.getInputs():
            self.input(prim, source)

    def input(self, prim: Sdf.PrimSpec, source: Any) -> None:
        interface = source.getInterfaceInput()
        node = source.getConnectedNode()
        if node is None and interface is not None:
            node, source_of_value = interface.getConnectedNode(), interface
        else:
            source_of_value = source
        type_name = TYPES.get(source.getType(), Sdf.ValueTypeNames.Token)
        value = None if node is not None else self.value(source_of_value)
        if node is None and value is None:
            return
        attribute = Sdf.AttributeSpec(prim, f"inputs:{source.getName()}", type_name)
        if node is not None:
            name = _output_name(source_of_value)
            attribute.connectionPathList.explicitItems = [self.output(node, name)]
            return
        attribute.default = value
        space = source_of_value.getActiveColorSpace()
        if space and (source.getType().startswith("color") or source.getType() == "filename"):
            attribute.colorSpace = space

    def value(self, source: Any) -> Any:
        """A value as USD holds it; None if there is none."""
        if source.getType() == "filename":
            return Sdf.AssetPath(self.file(source))
        value = source.getValue()
        if value is None or source.getType() not in TYPES:
            return None
        return value if isinstance(value, (bool, int, float, str)) else tuple(value)

    def file(self, source: Any) -> str:
        """The path of a file: with the document's prefix, or, as some files mean it, without."""
        names = [source.getResolvedValueString(), source.getValueString()]
        paths = [os.path.normpath(os.path.join(self.folder, name)) for name in names if name]
        return next((path for path in paths if os.path.exists(path)), paths[0] if paths else "")


def _output_name(port: Any) -> str:
    """Which output of the connected node a port reads, also through the output of a graph."""
    through = port.getConnectedOutput()
    if through is not None and port.hasNodeGraphString():
        return str(through.getOutputString())
    return str(port.getOutputString())
