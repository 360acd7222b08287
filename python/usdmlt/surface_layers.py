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
    averages = any(layer.source == "average" for layer in asked)
    seen = native.core().surface_layers(
        core_scene,
        filter=filter,
        samples=SAMPLES if averages else 0,
        ranks=cryptomatte.RANKS if averages else 0,
        threads=threads,
        poll=None if stop is None else lambda _: stop(),
    )
    names = Names(scene)
    for primvar in sorted({layer.primvar for layer in asked if layer.primvar}):
        if not any(primvar in mesh.primvars for mesh in all_meshes(scene)):
            logger.warning("no surface has the primvar %s: its layer is 0", primvar)
    for layer in asked:
        _add(result, layer, scene, names, seen)
    return result


def _add(
    result: SurfaceLayers, layer: Layer, scene: Scene, names: Names, seen: dict[str, Any]
) -> None:
    shape = (scene.height, scene.width)
    if layer.shows in CRYPTOMATTES:
        of = CRYPTOMATTES[layer.shows]
        numbers, called = names.numbers(of, seen[f"{of}_key"])
        ranked = (*shape, cryptomatte.RANKS)
        coverage = seen[f"{of}_coverage"].reshape(ranked)
        pixels, metadata = cryptomatte.layers(layer.name, numbers.reshape(ranked), coverage, called)
        result.channels |= pixels
        result.metadata |= metadata
        return
    if layer.kind == "id":
        numbers, called = names.ids(layer.shows, seen["key"])
        values: npt.NDArray[Any] = numbers.astype(np.uint32)
        if called:
            table = {called[i - 1]: i for i in np.unique(numbers).tolist() if i > 0}
            result.metadata[f"{layer.name}s"] = json.dumps(table, ensure_ascii=False)
    elif layer.primvar:
        values = primvar_at(scene, layer.primvar, seen)
        if layer.kind == "uv":
            values = np.pad(values, ((0, 0), (0, 1)))[:, :2]
        else:
            layer = of_width(layer, values.shape[1], _is_color(scene, layer.primvar))
    else:
        values = seen[layer.shows].astype(np.float32)
    width = values.size // (scene.width * scene.height)
    result.layers[layer.name] = layer
    result.channels[layer.name] = values.reshape(shape if width == 1 else (*shape, width))


def primvar_at(scene: Scene, name: str, seen: dict[str, Any]) -> npt.NDArray[np.float32]:
    """(pixels, width) float32: a primvar at the centres of pixels, 0 where there is none."""
    meshes, on = all_meshes(scene), seen["key"][:, 0]
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


class Names:
    """What the core counts, by name. Instances are ``MESH[NUMBER]``, in the order of the stage."""

    def __init__(self, scene: Scene) -> None:
        self.meshes = [mesh.name or f"mesh {i}" for i, mesh in enumerate(all_meshes(scene))]
        self.lights = [light.name or f"light {i}" for i, light in enumerate(scene.lights)]
        self.materials = [m.name or f"material {i}" for i, m in enumerate(scene.materials)]
        # Of each instance: the how manyth of its prototype.
        self.instances: list[int] = []
        counts: dict[int, int] = {}
        for placed in scene.instances:
            if scene.prototypes[placed.prototype].meshes:
                first = counts.get(placed.prototype, 0)
                counts[placed.prototype] = first + len(placed.transforms)
                self.instances += range(first, counts[placed.prototype])

    def numbers(
        self, of: str, keys: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.int64], list[str]]:
        """Of keys of an "object" (mesh, instance, light, ...) or a "material": which of the names
        it has that are returned; -1: none."""
        if of == "material":
            return keys.reshape(-1), self.materials
        rows, index = np.unique(keys[:, :3], axis=0, return_inverse=True)
        called = [self._object(*row) for row in rows.tolist()]
        numbers = np.array([-1 if name is None else i for i, name in enumerate(called)], np.int64)
        return numbers[index.reshape(-1)], [name or "" for name in called]

    def ids(
        self, layer: str, keys: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.int64], list[str]]:
        """Numbers from 1 on, 0 for nothing, and the names of 1, 2 ... if they have any."""
        mesh, instance, light, material = keys.T
        if layer == "materialId":
            return material + 1, self.materials
        if layer == "instanceId":
            return instance + 1, []
        objects = [*self.meshes, *self.lights]
        names = list(dict.fromkeys(objects))
        number = {name: i + 1 for i, name in enumerate(names)}
        table = np.array([0, *(number[name] for name in objects)])
        return table[np.where(light >= 0, len(self.meshes) + light, mesh) + 1], names

    def _object(self, mesh: int, instance: int, light: int) -> str | None:
        if light >= 0:
            return self.lights[light]
        if mesh < 0:
            return None
        return self.meshes[mesh] + (f"[{self.instances[instance]}]" if instance >= 0 else "")
