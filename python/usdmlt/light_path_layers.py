"""Layers of light paths for the core: which expressions a path has, and what its light is called.

A light is called by its group and by its prim path; lights without a group are of the group
``"default"``.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from usdmlt import light_path_expressions
from usdmlt.layers import Layer, light_group
from usdmlt.surface_layers import all_meshes

if TYPE_CHECKING:
    from usdmlt.scene import Light, Mesh, Scene

logger = logging.getLogger("usdmlt")

DEFAULT_GROUP = "default"
ALL_GROUPS = "lightGroups"


class LightPathLayers(NamedTuple):
    """What the core is told: the automaton of so many ``layers``; of every light of the scene
    and of every mesh's emission, its kind; and whether a mesh is a light. Meshes count those of the
    scene first, then those of its prototypes."""

    layers: int
    next: npt.NDArray[np.uint16]
    masks: npt.NDArray[np.uint64]
    of_light: npt.NDArray[np.int32]
    of_mesh: npt.NDArray[np.int32]
    mesh_is_light: npt.NDArray[np.bool_]
    of_media: int


def light_groups(scene: Scene) -> list[str]:
    """The groups of all that emits, or could, in order of the alphabet."""
    sources: list[Light | Mesh] = [*scene.lights, *(m for m in all_meshes(scene) if _may_emit(m))]
    return sorted({source.light_group or DEFAULT_GROUP for source in sources} | {DEFAULT_GROUP})


def expanded(layers: Sequence[Layer], scene: Scene) -> list[Layer]:
    """The layers, with one for each group in the place of ``lightGroups``."""
    result: list[Layer] = []
    for layer in layers:
        if layer.shows == ALL_GROUPS:
            result += [light_group(group) for group in light_groups(scene)]
        else:
            result.append(layer)
    return list(dict.fromkeys(result))


def compiled_for(scene: Scene, layers: Sequence[Layer]) -> LightPathLayers:
    """For layers of light paths, whose expressions have been read before. Warns of names in them
    that nothing has."""
    expressions = [light_path_expressions.parse(layer.shows) for layer in layers]
    names = frozenset[str]().union(*map(light_path_expressions.names_in, expressions))
    meshes = all_meshes(scene)
    there = {name for source in (*scene.lights, *meshes) for name in _names(source)}
    for name in sorted(names - there - {DEFAULT_GROUP}):
        logger.warning("no light is of the group or the path %s", name)
    kinds: dict[frozenset[str], int] = {}

    def kind(source: Light | Mesh) -> int:
        return kinds.setdefault(names & _names(source), len(kinds))

    of_light = np.array([kind(light) for light in scene.lights], np.int32)
    of_mesh = np.array([kind(mesh) for mesh in meshes], np.int32)
    of_media = kinds.setdefault(names & {DEFAULT_GROUP}, len(kinds))
    automaton = light_path_expressions.compiled(expressions, list(kinds))
    return LightPathLayers(
        len(layers),
        automaton.next,
        automaton.masks,
        of_light,
        of_mesh,
        np.array([mesh.is_light for mesh in meshes], bool),
        of_media,
    )


def _names(source: Light | Mesh) -> set[str]:
    return {source.light_group or DEFAULT_GROUP, source.name}


def _may_emit(mesh: Mesh) -> bool:
    return mesh.is_light or bool(mesh.light_group)
