"""Shading networks: what feeds an input, through node graphs and material interfaces.

A shader input is a number or colour, or comes from another node's output. Nodes that become
inputs of the scene description (textures, primvar readers, constants) are listed in
``patterns.NODES``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pxr import Sdf, Usd, UsdShade

from usdmlt.errors import Error, Report
from usdmlt.scene import INPUT_NODES, Input, Node
from usdmlt.stage.color import ColorSpaces

if TYPE_CHECKING:
    from usdmlt.stage.textures import Textures

# data: three numbers that are no colour; value: as many as there are, a colour where typed as one
Kind = Literal["color", "float", "float2", "data", "value"]


class Unusable(Exception):
    """A network that cannot be rendered: the reason, and the prim it is found at."""

    def __init__(self, reason: str, path: object):
        super().__init__(f"{reason}: {path}")
        self.reason = reason
        self.path = path


@dataclass
class Source:
    """Where an input's value comes from: a shader's output, or an attribute that holds a value."""

    attribute: Usd.Attribute
    shader: UsdShade.Shader | None = None
    output: str = ""

    @property
    def node(self) -> str:
        """The shader's identifier; "" for a value."""
        return node_id(self.shader) if self.shader else ""


@dataclass
class Networks:
    """Reads inputs of shaders at one time, into one colour space."""

    time: Usd.TimeCode
    colors: ColorSpaces
    textures: Textures
    report: Report
    refuse_unknown: bool = False  # nodes that are not known make the whole material unusable
    _active: list[Sdf.Path] = field(default_factory=list)
    _read: dict[tuple[Sdf.Path, str, Kind], Input | None] = field(default_factory=dict)

    def source(self, shader: UsdShade.Shader, name: str) -> Source | None:
        """What feeds an input; None if it has no value. Unconnected ends fall back to its own.

        Raises :class:`Unusable` where connections go round in a circle.
        """
        shader_input = shader.GetInput(name)
        if not shader_input:
            return None
        own = shader_input.GetAttr()
        if not own.HasAuthoredConnections():
            return Source(own) if own.HasAuthoredValue() else None
        follow_no_circle(own)
        for attribute in UsdShade.Utils.GetValueProducingAttributes(shader_input):
            output, kind = UsdShade.Utils.GetBaseNameAndType(attribute.GetName())
            if kind == UsdShade.AttributeType.Output:
                return Source(attribute, UsdShade.Shader(attribute.GetPrim()), output)
            if attribute != own:  # an input of a node graph or a material
                return Source(attribute)
        undeclared = undeclared_output(own)
        if undeclared is not None:
            return undeclared
        # A source that exists but has no value means its default.
        stage = own.GetStage()
        if not any(stage.GetAttributeAtPath(path) for path in own.GetConnections()):
            self.report.warn("shader inputs are connected to nothing", own.GetPath())
        return Source(own) if own.HasAuthoredValue() else None

    def read(self, shader: UsdShade.Shader, name: str, default: Any, kind: Kind) -> Input:
        """An input of the scene description: a constant, a texture or a primvar.

        What cannot be rendered gives ``default``, with a warning.
        """
        source = self.source(shader, name)
        if source is None:
            return default
        if source.shader is None:
            return self.constant(source.attribute, default, kind)
        return self.read_node(source, default, kind)

    def read_node(self, source: Source, default: Any, kind: Kind) -> Input:
        """The input that a node's output stands for."""
        from usdmlt.stage.patterns import node_reader

        path = source.shader.GetPath()
        known = (path, source.output, kind)
        if known in self._read:  # nodes that feed several inputs are one
            value = self._read[known]
            return default if value is None else value
        reader = node_reader(source.node)
        if reader is None:
            reason = f"shader nodes of type {source.node or '(no identifier)'} are not rendered"
            if self.refuse_unknown:
                raise Unusable(reason, path)
            self.report.warn(reason, path)
            return default
        with entered(self._active, path):
            value = reader(self, source, kind)
        if isinstance(value, Node):
            self._read[known] = value
        return default if value is None else value

    def constant(self, attribute: Usd.Attribute, default: Any, kind: Kind) -> Any:
        """A value of an attribute as the consumer wants it."""
        value = attribute.Get(self.time)
        if value is None:
            return default
        try:
            numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
        except (TypeError, ValueError):
            self.report.warn("shader inputs of the wrong type are ignored", attribute.GetPath())
            return default
        if not np.isfinite(numbers).all():
            raise Error(f"{attribute.GetPath()}: not a finite value")
        if kind == "value":
            return self._authored(numbers.ravel()[:4], attribute)
        if kind == "float":
            return float(numbers[0])
        if kind == "float2":
            return (float(numbers[0]), float(numbers[-1 if len(numbers) < 2 else 1]))
        if len(numbers) < 3:
            numbers = np.full(3, numbers[0])
        if kind == "color":
            return self.colors.color(numbers, attribute)
        return (float(numbers[0]), float(numbers[1]), float(numbers[2]))

    def _authored(self, numbers: np.ndarray, attribute: Usd.Attribute) -> Any:
        """All numbers of a value; those of a colour type in the rendering space."""
        if len(numbers) == 1:
            return float(numbers[0])
        found = tuple(map(float, numbers))
        if attribute.GetTypeName().role == "Color":
            return (*self.colors.color(found[:3], attribute), *found[3:])
        return found

    def numbers(
        self, shader: UsdShade.Shader, name: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Plain numbers, as many as ``default`` has: one is repeated, missing ones are its own."""
        value = self.value(shader, name, default)
        try:
            found = np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel().tolist()
        except (TypeError, ValueError):
            found = []
        if not found or not np.isfinite(found).all():
            self.report.warn("shader inputs of the wrong type are ignored", shader.GetPath())
            return default
        if len(found) == 1:
            found *= len(default)
        return (*found, *default[len(found) :])[: len(default)]

    def number(self, shader: UsdShade.Shader, name: str, default: float) -> float:
        """One plain number."""
        return self.numbers(shader, name, (default,))[0]

    def value(self, shader: UsdShade.Shader, name: str, default: Any) -> Any:
        """A plain value (a token, string, integer, asset); ``default`` if a node feeds it."""
        source = self.source(shader, name)
        if source is None:
            return default
        if source.shader is not None:
            self.report.warn("textured inputs that must be constant are ignored", shader.GetPath())
            return default
        value = source.attribute.Get(self.time)
        return default if value is None else value


def node_id(shader: UsdShade.Shader) -> str:
    """The identifier of a shader node; "" if it is implemented by an asset or by source code."""
    return str(shader.GetIdAttr().Get() or "") if shader else ""


def undeclared_output(attribute: Usd.Attribute) -> Source | None:
    """The shader an attribute is connected to by an output that the shader does not declare.

    Strictly such a connection leads nowhere; hand-written files have it, and its meaning is clear.
    """
    for path in attribute.GetConnections():
        prim = attribute.GetStage().GetPrimAtPath(path.GetPrimPath())
        output, kind = UsdShade.Utils.GetBaseNameAndType(path.name)
        if kind == UsdShade.AttributeType.Output and prim and prim.IsA(UsdShade.Shader):
            return Source(attribute, UsdShade.Shader(prim), output)
    return None


@contextmanager
def entered(active: list[Sdf.Path], path: Sdf.Path) -> Iterator[None]:
    """While a node is read, it is one of the ``active``; :class:`Unusable` where it is already."""
    if path in active:
        raise Unusable("shading networks go round in a circle", path)
    active.append(path)
    try:
        yield
    finally:
        active.pop()


def follow_no_circle(attribute: Usd.Attribute) -> None:
    """Raise :class:`Unusable` where interface connections lead back to themselves."""
    stage = attribute.GetStage()
    trail, ahead = set(), attribute.GetConnections()
    for _ in range(1000):
        if not ahead:
            return
        path = ahead[0]
        if path in trail:
            raise Unusable("shading networks go round in a circle", attribute.GetPath())
        trail.add(path)
        following = stage.GetAttributeAtPath(path)
        ahead = following.GetConnections() if following else []


def is_zero(value: Input) -> bool:
    """Whether an input is the constant 0, or black."""
    if isinstance(value, (int, float)):
        return value == 0
    return not isinstance(value, INPUT_NODES) and not np.any(np.asarray(value))
