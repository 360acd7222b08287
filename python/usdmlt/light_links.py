"""Light links for the core: which kinds of meshes are in which collections.

Meshes that are in the same collections are of one kind. There are few of them, so that the core's
table of kinds and collections is small, whatever the numbers of meshes and lights.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from usdmlt.scene import Scene


class CompiledLinks(NamedTuple):
    """``members`` (kinds, collections) uint8; empty where no light is linked. Of every light of the
    scene, of every mesh's emission: the collection, -1 for none. Of every mesh: its kind. Meshes
    count those of the scene first, then those of its prototypes."""

    members: np.ndarray
    of_light: np.ndarray
    of_mesh: np.ndarray
    kind_of_mesh: np.ndarray


def compile_light_links(scene: Scene) -> CompiledLinks:
    """What the core is told of a scene's ``light_link`` and ``collections``."""
    meshes = [*scene.meshes, *(mesh for p in scene.prototypes for mesh in p.meshes)]
    links = [light.light_link for light in scene.lights]
    emission = [mesh.light_link for mesh in meshes]
    names = [name for name in dict.fromkeys([*links, *emission]) if name is not None]
    column = {name: index for index, name in enumerate(names)}
    kinds: dict[frozenset[str], int] = {}
    known = frozenset(names)
    kind_of_mesh = [
        kinds.setdefault(known.intersection(mesh.collections), len(kinds)) for mesh in meshes
    ]
    members = np.zeros((len(kinds), len(names)), dtype=np.uint8)
    for inside, kind in kinds.items():
        members[kind, [column[name] for name in inside]] = 1

    def columns(of: list[str | None]) -> np.ndarray:
        return np.array([-1 if name is None else column[name] for name in of], dtype=np.int32)

    return CompiledLinks(
        members, columns(links), columns(emission), np.array(kind_of_mesh, dtype=np.int32)
    )
