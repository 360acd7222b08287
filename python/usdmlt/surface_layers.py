"""Layers of what the camera sees, by a pass of rays of its own (cpp/layers/surface_layers.hpp).

Positions, normals, depths, ids, primvars and motion are those at the centre of a pixel, no averages
of what may be far apart; albedo and Cryptomatte are averages over the pixel's filter, the lens and
the shutter.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from usdmlt import cryptomatte, native
from usdmlt.layers import Layer, of_width

if TYPE_CHECKING:
    from usdmlt import _core
    from usdmlt.scene import Mesh, Scene

logger = logging.getLogger("usdmlt")

SAMPLES = 64  # of averages, per pixel
CRYPTOMATTES = {"CryptoObject": "object", "CryptoMaterial": "material"}


@dataclass
class SurfaceLayers:
    """``channels`` and what they are, by name; what a file says of them."""

    channels: dict[str, npt.NDArray[Any]] = field(default_factory=dict)
    layers: dict[str, Layer] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)


def surface_layers(
    scene: Scene,
    core_scene: _core.Scene,
    asked: Sequence[Layer],
    filter: str,
    threads: int,
    stop: Callable[[], bool] | None = None,
) -> SurfaceLayers:
    """Those of ``asked`` that are of surfaces; after ``stop()``, averages are coarse."""
    result = SurfaceLayers()
    asked = [layer for layer in asked if layer.source in ("centre", "average")]
    if not asked:
        return result
    seen = native.core().surface_layers(
        core_scene,
        {name for layer in asked for name in _needed(layer)},
        filter=filter,
        samples=SAMPLES,
        ranks=cryptomatte.RANKS,
        threads=threads,
        poll=None if stop is None else lambda _: stop(),
    )
    objects = Objects(scene)
    for primvar in sorted({layer.primvar for layer in asked if layer.primvar}):
        if not any(primvar in mesh.primvars for mesh in all_meshes(scene)):
            logger.warning("no surface has the primvar %s: its layer is 0", primvar)
    for layer in asked:
        _add(result, layer, scene, objects, seen)
    return result


def _needed(layer: Layer) -> tuple[str, ...]:
    """What the core is asked for."""
    if layer.shows in CRYPTOMATTES:
        return ("coverage",)
    if layer.shows in ("objectId", "instanceId"):
        return ("object",)
    if layer.shows == "materialId":
        return ("material",)
    return ("object", "triangle") if layer.primvar else (layer.shows,)


def _add(
    result: SurfaceLayers, layer: Layer, scene: Scene, objects: Objects, seen: dict[str, Any]
) -> None:
    shape = (scene.height, scene.width)
    if layer.shows in CRYPTOMATTES:
        of = CRYPTOMATTES[layer.shows]
        ranked = (*shape, cryptomatte.RANKS)
        pixels, metadata = cryptomatte.layers(
            layer.name,
            seen[f"covering_{of}"].reshape(ranked),
            seen[f"{of}_coverage"].reshape(ranked),
            objects.names if of == "object" else lambda numbers: material_names(scene, numbers),
        )
        result.channels |= pixels
        result.metadata |= metadata
        return
    values: npt.NDArray[Any]
    if layer.kind == "id":
        values, table = _ids(layer.shows, scene, objects, seen)
        if table:
            result.metadata[f"{layer.name}s"] = json.dumps(table, ensure_ascii=False)
    elif layer.primvar:
        values = primvar_at(scene, objects, layer.primvar, seen)
        if layer.kind == "uv":
            values = np.pad(values, ((0, 0), (0, 1)))[:, :2]
        else:
            layer = of_width(layer, values.shape[1], _is_color(scene, layer.primvar))
    else:
        values = seen[layer.shows]
    width = values.size // (scene.width * scene.height)
    result.layers[layer.name] = layer
    result.channels[layer.name] = values.reshape(shape if width == 1 else (*shape, width))


def _ids(
    name: str, scene: Scene, objects: Objects, seen: dict[str, Any]
) -> tuple[npt.NDArray[np.uint32], dict[str, int]]:
    """Numbers from 1 on, 0 for nothing, and those that are there by name, if they have names."""
    if name == "materialId":
        numbers = seen["material"][:, 0] + 1
        called = material_names(scene, np.arange(len(scene.materials)))
    else:
        mesh, instance, light = objects.parts(seen["object"][:, 0])
        if name == "instanceId":
            return (instance + 1).astype(np.uint32), {}
        all_names = [*objects.mesh_names, *objects.light_names]
        called = list(dict.fromkeys(all_names))
        number = {one: i + 1 for i, one in enumerate(called)}
        table = np.array([0, *(number[one] for one in all_names)])
        numbers = table[np.where(light >= 0, len(objects.mesh_names) + light, mesh) + 1]
    there = np.flatnonzero(np.bincount(numbers)).tolist()
    return numbers.astype(np.uint32), {called[i - 1]: i for i in there if i > 0}


def primvar_at(
    scene: Scene, objects: Objects, name: str, seen: dict[str, Any]
) -> npt.NDArray[np.float32]:
    """(pixels, width) float32: a primvar at the centres of pixels, 0 where there is none."""
    meshes, on = all_meshes(scene), objects.parts(seen["object"][:, 0])[0]
    found = [i for i in np.unique(on[on >= 0]).tolist() if name in meshes[i].primvars]
    columns = [np.atleast_2d(meshes[i].primvars[name].values.T).T for i in found]
    result = np.zeros((len(on), max((c.shape[1] for c in columns), default=1)), np.float32)
    for i, values in zip(found, columns, strict=True):
        mesh, pixels = meshes[i], np.flatnonzero(on == i)
        corners = mesh.primvars[name].corners
        triangles = mesh.triangles if corners is None else corners
        u, v = seen["barycentrics"][pixels].T
        if np.linalg.det(mesh.transform[:3, :3]) < 0:  # the core turns such triangles over
            u, v = v, u
        weights = np.stack([1 - u - v, u, v], axis=1)
        chosen = values[triangles[seen["triangle"][pixels, 0]]]
        result[pixels, : values.shape[1]] = np.einsum("nc,ncw->nw", weights, chosen)
    return result


def _is_color(scene: Scene, name: str) -> bool:
    primvars = (mesh.primvars.get(name) for mesh in all_meshes(scene))
    return any(primvar is not None and primvar.is_color for primvar in primvars)


def all_meshes(scene: Scene) -> list[Mesh]:
    """As the core counts them."""
    return [*scene.meshes, *(mesh for p in scene.prototypes for mesh in p.meshes)]


def material_names(scene: Scene, numbers: npt.NDArray[Any]) -> list[str]:
    """The names of some materials."""
    return [scene.materials[i].name or f"material {i}" for i in numbers.tolist()]


class Objects:
    """What the core's numbers of objects mean: the meshes of the world, those of each instance in
    turn, the lights. An object of an instance is called ``MESH[NUMBER]``, by the place of the
    instance among those of its prototype."""

    def __init__(self, scene: Scene) -> None:
        self.mesh_names = [mesh.name or f"mesh {i}" for i, mesh in enumerate(all_meshes(scene))]
        self.light_names = [light.name or f"light {i}" for i, light in enumerate(scene.lights)]
        self.world = len(scene.meshes)
        sizes = [len(prototype.meshes) for prototype in scene.prototypes]
        first_mesh = self.world + np.cumsum([0, *sizes])
        placed = [p for p in scene.instances if sizes[p.prototype] > 0]
        prototype = np.repeat([p.prototype for p in placed], [len(p.transforms) for p in placed])
        prototype = prototype.astype(np.int64)
        # Of each instance: its first object, the mesh that this is, and its place.
        ends = self.world + np.cumsum(np.array(sizes, np.int64)[prototype])
        self.first = np.concatenate([[self.world], ends[:-1]]) if len(ends) else ends
        self.first_light = int(ends[-1]) if len(ends) else self.world
        self.mesh = first_mesh[prototype]
        self.place = np.zeros(len(prototype), np.int64)
        for one in np.unique(prototype):
            of_it = prototype == one
            self.place[of_it] = np.arange(np.count_nonzero(of_it))

    def parts(self, numbers: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], ...]:
        """Of objects: mesh, instance and light, -1 for none."""
        light = np.where(numbers >= self.first_light, numbers - self.first_light, -1)
        instance = np.full(len(numbers), -1)
        mesh = np.where(light >= 0, -1, numbers)
        inside = (numbers >= self.world) & (light < 0)
        if inside.any():
            which = np.searchsorted(self.first, numbers[inside], side="right") - 1
            instance[inside] = which
            mesh[inside] = self.mesh[which] + numbers[inside] - self.first[which]
        return mesh, instance, light

    def names(self, numbers: npt.NDArray[Any]) -> list[str]:
        """Of objects."""
        return [
            self.light_names[light]
            if light >= 0
            else self.mesh_names[mesh] + (f"[{self.place[instance]}]" if instance >= 0 else "")
            for mesh, instance, light in zip(
                *(p.tolist() for p in self.parts(numbers)), strict=True
            )
        ]
