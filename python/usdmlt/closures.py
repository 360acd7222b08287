"""Materials of a scene description, compiled for the core.

A closure tree becomes a program in postfix order, and every primvar that a material reads gets a
slot, the same over the whole scene. The result is plain data: numbers, strings, tuples and dicts.

What feeds the closures is a list of *values*, each one of::

    (x, y, z, w)                       a constant; a number fills all four
    (node, width, data, [inputs])      a node of the core; inputs index values before it

and the parameters of operations index that list.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from usdmlt import scene

Value = tuple[Any, ...]
Operation = dict[str, Any]
CompiledMaterial = dict[str, Any]

CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
TANGENT_PRIMVAR = "st"  # what anisotropy runs along where no normal map names another primvar


class PrimvarSlots:
    """Slots of the primvars that materials read, numbered as they come up."""

    def __init__(self) -> None:
        self.slots: dict[str, int] = {}

    def __getitem__(self, name: str) -> int:
        return self.slots.setdefault(name, len(self.slots))


def compile_materials(
    description: scene.Scene,
) -> tuple[list[CompiledMaterial], dict[str, int]]:
    """The scene's materials as programs, and the slot of every primvar they read.

    Each program is a dict of ``name``, ``values``, ``tile_sets`` (of UDIM numbers and textures),
    ``operations``, ``opacity``, ``opacity_threshold``, ``normal`` (a value or None),
    ``tangent_primvar`` (a slot or None), ``tangent_rotation`` and ``thin_walled``. Raises
    ValueError, naming the material, for a value that is no input and a texture that the scene does
    not have.
    """
    slots = PrimvarSlots()
    count = len(description.textures)
    return [compile_material(m, slots, count) for m in description.materials], slots.slots


def compile_material(
    material: scene.Material, slots: PrimvarSlots, texture_count: int
) -> CompiledMaterial:
    """One material as a program; see :func:`compile_materials`."""
    compiler = _Compiler(slots, texture_count)
    try:
        operations = [] if material.closure is None else list(compiler.closure(material.closure))
        opacity = compiler.parameter(material.opacity)
        rotation = compiler.parameter(material.tangent_rotation)
        normal = None
        # Without an image there is nothing to perturb the normal with.
        if material.normal is not None and texture_primvar(material.normal) is not None:
            normal = compiler.parameter(material.normal)
    except (TypeError, ValueError) as error:
        raise ValueError(f"material '{material.name}': {error}") from error
    tangent_primvar = None
    if normal is not None and material.normal is not None:
        tangent_primvar = slots[texture_primvar(material.normal) or TANGENT_PRIMVAR]
    elif compiler.is_anisotropic:
        tangent_primvar = slots[TANGENT_PRIMVAR]
    return {
        "name": material.name,
        "values": compiler.values,
        "tile_sets": compiler.tile_sets,
        "operations": operations,
        "opacity": opacity,
        "opacity_threshold": float(material.opacity_threshold),
        "normal": normal,
        "tangent_primvar": tangent_primvar,
        "tangent_rotation": rotation,
        "thin_walled": bool(material.thin_walled),
    }


# The operations and their inputs in the core's order. A tuple names a GGX roughness: two numbers.
LOBES: dict[type, tuple[str, tuple[str | tuple[str], ...]]] = {
    scene.Diffuse: ("diffuse", ("color", "weight", "roughness")),
    scene.Translucent: ("translucent", ("color", "weight")),
    scene.Dielectric: (
        "dielectric",
        ("ior", ("roughness",), "tint", "reflection_tint", "transmission_tint", "weight"),
    ),
    scene.Conductor: ("conductor", ("ior", "extinction", ("roughness",), "weight")),
    scene.GeneralizedSchlick: (
        "schlick",
        ("color0", "color82", "color90", "exponent", ("roughness",), "weight"),
    ),
    scene.Sheen: ("sheen", ("color", "weight", "roughness")),
    scene.UniformEmission: ("emission", ("color",)),
    scene.PreviewSurface: (
        "preview_surface",
        (
            *("diffuseColor", "emissiveColor", "specularColor", "metallic", "roughness"),
            *("clearcoat", "clearcoatRoughness", "opacity", "ior"),
        ),
    ),
}
# Operations on closures: the closures they take, in order, then their inputs.
COMBINATIONS: dict[type, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    scene.Layer: ("layer", ("top", "base"), ()),
    scene.Mix: ("mix", ("foreground", "background"), ("mix",)),
    scene.Add: ("add", ("a", "b"), ()),
    scene.Multiply: ("multiply", ("closure",), ("factor",)),
}


class _Compiler:
    def __init__(self, slots: PrimvarSlots, texture_count: int) -> None:
        self.slots = slots
        self.texture_count = texture_count
        self.is_anisotropic = False
        self.values: list[Value] = []
        self.tile_sets: list[list[tuple[int, int]]] = []
        self._numbers: dict[Any, int] = {}  # of values that are there already
        self._nodes: dict[int, tuple[scene.Node, int]] = {}  # by id; keeps the node alive

    def closure(self, closure: scene.Closure) -> Iterator[Operation]:
        """The operations of a closure tree, operands before what combines them."""
        inputs: tuple[str | tuple[str], ...]
        if type(closure) in LOBES:
            kind, inputs = LOBES[type(closure)]
            if getattr(closure, "energy_compensation", False):
                kind = "eon"
        elif type(closure) in COMBINATIONS:
            kind, operands, inputs = COMBINATIONS[type(closure)]
            for name in operands:
                yield from self.closure(getattr(closure, name))
        else:
            raise TypeError(f"{type(closure).__name__} is not a closure")
        parameters: list[int] = []
        for item in inputs:
            if isinstance(item, tuple):
                parameters += map(self.parameter, self.alphas(getattr(closure, item[0])))
            else:
                parameters.append(self.parameter(getattr(closure, item)))
        scatter_mode = getattr(closure, "scatter_mode", "R")
        if scatter_mode not in ("R", "T", "RT"):
            raise ValueError(f"scatter mode {scatter_mode!r} is none of R, T and RT")
        yield {
            "type": kind,
            "scatter_mode": scatter_mode,
            "specular_workflow": bool(getattr(closure, "useSpecularWorkflow", False)),
            "parameters": parameters,
        }

    def alphas(self, roughness: scene.Roughness) -> tuple[scene.Input, scene.Input]:
        """Along x and y: a pair is both, anything else is the same for both."""
        if isinstance(roughness, tuple) and len(roughness) == 2:
            x, y = roughness
            self.is_anisotropic |= x is not y and not (_is_number(x) and x == y)
            return x, y
        return roughness, roughness

    def parameter(self, value: scene.Input) -> int:
        """The number of the value that an input of a closure is."""
        if not isinstance(value, scene.INPUT_NODES):
            numbers = np.asarray(value, dtype=np.float64)
            if numbers.shape not in ((), (3,)):
                raise ValueError(f"{value!r} is neither a number nor a colour")
        return self.value(value)

    def value(self, value: scene.Input) -> int:
        """The number of a value; equal ones share it."""
        if isinstance(value, scene.Node):
            if id(value) not in self._nodes:
                inputs = [self.value(v) for v in value.inputs]
                number = self.append(value.operation, value.width, value.data, inputs)
                self._nodes[id(value)] = (value, number)
            return self._nodes[id(value)][1]
        if isinstance(value, scene.TextureInput):
            return self.texture(value)
        if isinstance(value, scene.PrimvarInput):
            fallback = self.value(value.fallback)
            return self.append("primvar", 3, self.slots[value.primvar], [fallback])
        return self.constant(value)

    def append(self, node: str, width: int, data: int, inputs: list[int]) -> int:
        return self._number((node, int(width), int(data), tuple(inputs)))

    def constant(self, value: object) -> int:
        """One to four numbers; one fills all lanes."""
        numbers = np.asarray(value, dtype=np.float64)
        if numbers.ndim > 1 or not 0 < numbers.size <= 4:
            raise ValueError(f"{value!r} is neither a number nor a vector")
        lanes = np.zeros(4)
        lanes[: numbers.size] = numbers
        if numbers.size == 1:
            lanes[:] = numbers
        return self._number(tuple(map(float, lanes)))

    def _number(self, value: Value) -> int:
        key = tuple(map(str, value))  # not a number differs from itself, but "nan" does not
        if key not in self._numbers:
            self._numbers[key] = len(self.values)
            self.values.append(value)
        return self._numbers[key]

    def texture(self, value: scene.TextureInput) -> int:
        if value.channel != "rgb" and value.channel not in CHANNELS:
            raise ValueError(f"channel {value.channel!r} is none of rgb, r, g, b and a")
        if value.texture is None:
            if value.channel == "rgb":
                return self.constant(value.fallback[:3])
            return self.constant(value.fallback[CHANNELS[value.channel]])
        texel = self.lookup(value.texture, self.coordinates(value))
        if tuple(value.scale) != (1, 1, 1, 1):
            texel = self.append("multiply", 4, 0, [texel, self.constant(value.scale)])
        if tuple(value.bias) != (0, 0, 0, 0):
            texel = self.append("add", 4, 0, [texel, self.constant(value.bias)])
        if value.channel == "rgb":
            return texel
        return self.append("extract", 1, CHANNELS[value.channel], [texel])

    def coordinates(self, value: scene.TextureInput) -> int:
        """Where a texture is read."""
        transform = np.asarray(value.transform, dtype=np.float64)
        if transform.shape != (2, 3):
            raise ValueError(f"a texture transform is (2, 3), not {transform.shape}")
        if value.coordinates is not None:
            st = self.value(value.coordinates)
        else:
            st = self.append("primvar", 2, self.slots[value.primvar], [self.constant((0, 0))])
        if np.array_equal(transform, [[1, 0, 0], [0, 1, 0]]):
            return st
        return self.append("affine", 2, 0, [st, *(self.constant(row) for row in transform)])

    def lookup(self, texture: int | dict[int, int], st: int) -> int:
        for index in texture.values() if isinstance(texture, dict) else [texture]:
            if not 0 <= index < self.texture_count:
                raise ValueError(f"texture {index} is none of the scene's")
        if not isinstance(texture, dict):
            return self.append("texture", 4, texture, [st])
        numbered = sorted(texture.items())
        if numbered not in self.tile_sets:
            self.tile_sets.append(numbered)
        return self.append("udim", 4, self.tile_sets.index(numbered), [st])


def texture_primvar(value: object) -> str | None:
    """The primvar of the first texture that an input depends on; None if it reads none."""
    if isinstance(value, scene.TextureInput):
        if value.texture is None:
            return None
        return texture_primvar(value.coordinates) or value.primvar
    if isinstance(value, scene.Node):
        return next((p for p in map(texture_primvar, value.inputs) if p is not None), None)
    return None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating))
