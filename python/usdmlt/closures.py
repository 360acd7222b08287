"""Materials of a scene description, compiled for the core.

A closure tree becomes a program in postfix order, and every primvar that a material reads gets a
slot, the same over the whole scene. The result is plain data: numbers, strings, tuples and dicts.

A *parameter* is one of::

    (red, green, blue)                                                        a constant
    ("texture", texture, slot, channel, scale, bias, transform)               six floats last
    ("primvar", slot, fallback)
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from usdmlt import scene

Parameter = tuple[Any, ...]
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

    Each program is a dict of ``name``, ``operations``, ``opacity``, ``opacity_threshold``,
    ``normal`` (a parameter or None) and ``tangent_primvar`` (a slot or None). Raises ValueError,
    naming the material, for a value that is no input and a texture that the scene does not have.
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
        normal = None
        # Without an image there is nothing to perturb the normal with.
        if material.normal is not None and material.normal.texture is not None:
            normal = compiler.parameter(material.normal)
    except (TypeError, ValueError) as error:
        raise ValueError(f"material '{material.name}': {error}") from error
    tangent_primvar = None
    if normal is not None and material.normal is not None:
        tangent_primvar = slots[material.normal.primvar]
    elif compiler.is_anisotropic:
        tangent_primvar = slots[TANGENT_PRIMVAR]
    return {
        "name": material.name,
        "operations": operations,
        "opacity": opacity,
        "opacity_threshold": float(material.opacity_threshold),
        "normal": normal,
        "tangent_primvar": tangent_primvar,
    }


# The operations and their inputs in the core's order. A tuple names a GGX roughness: two numbers.
LOBES: dict[type, tuple[str, tuple[str | tuple[str], ...]]] = {
    scene.Diffuse: ("diffuse", ("color", "weight", "roughness")),
    scene.Translucent: ("translucent", ("color", "weight")),
    scene.Dielectric: ("dielectric", ("ior", ("roughness",), "tint", "weight")),
    scene.Conductor: ("conductor", ("ior", "extinction", ("roughness",), "weight")),
    scene.GeneralizedSchlick: (
        "schlick",
        ("color0", "color90", "exponent", ("roughness",), "weight"),
    ),
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

    def closure(self, closure: scene.Closure) -> Iterator[Operation]:
        """The operations of a closure tree, operands before what combines them."""
        inputs: tuple[str | tuple[str], ...]
        if type(closure) in LOBES:
            kind, inputs = LOBES[type(closure)]
        elif type(closure) in COMBINATIONS:
            kind, operands, inputs = COMBINATIONS[type(closure)]
            for name in operands:
                yield from self.closure(getattr(closure, name))
        else:
            raise TypeError(f"{type(closure).__name__} is not a closure")
        parameters: list[Parameter] = []
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

    def parameter(self, value: scene.Input) -> Parameter:
        if isinstance(value, scene.TextureInput):
            return self.texture(value)
        if isinstance(value, scene.PrimvarInput):
            return ("primvar", self.slots[value.primvar], _constant(value.fallback))
        return _constant(value)

    def texture(self, value: scene.TextureInput) -> Parameter:
        if value.channel != "rgb" and value.channel not in CHANNELS:
            raise ValueError(f"channel {value.channel!r} is none of rgb, r, g, b and a")
        if value.texture is None:
            if value.channel == "rgb":
                return _constant(value.fallback[:3])
            return _constant(value.fallback[CHANNELS[value.channel]])
        if not 0 <= value.texture < self.texture_count:
            raise ValueError(f"texture {value.texture} is none of the scene's")
        transform = np.asarray(value.transform, dtype=np.float64)
        if transform.shape != (2, 3):
            raise ValueError(f"a texture transform is (2, 3), not {transform.shape}")
        return (
            "texture",
            value.texture,
            self.slots[value.primvar],
            value.channel,
            tuple(map(float, value.scale)),
            tuple(map(float, value.bias)),
            tuple(map(float, transform.ravel())),
        )


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating))


def _constant(value: object) -> Parameter:
    """A float or a colour as three floats."""
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.ndim == 0:
        return (float(numbers),) * 3
    if numbers.shape != (3,):
        raise ValueError(f"{value!r} is neither a number nor a colour")
    return tuple(map(float, numbers))
