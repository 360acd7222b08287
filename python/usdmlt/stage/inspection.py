"""What would be rendered of a stage, and what not."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

from pxr import Usd

from usdmlt.errors import Report, Warning
from usdmlt.options import LoadOptions
from usdmlt.stage.contents import PrimCount, count_prims
from usdmlt.stage.loading import Reading, read_stage


@dataclass
class Inspection:
    """The content of a stage as it would be rendered.

    ``prims``: what the stage has, by type, and what becomes of it. ``settings``: fields of
    :class:`usdmlt.Settings` that the stage asks for. ``products``: paths and files. ``layers``:
    beside those of every picture.
    ``data_window``: (x, y, full width, full height), None where the whole picture is rendered.
    ``lens_radius``: 0 is a pinhole. ``triangles``: distinct ones; ``triangles_instanced``: with
    every placement counted. ``warnings``: each kind of content that is not rendered as authored,
    with all its prim paths.
    """

    stage: str
    frame: float | None
    prims: list[PrimCount]
    render_settings: str | None
    settings: dict[str, Any]
    products: list[tuple[str, str]]
    layers: list[tuple[str, str]]  # (name, what it shows)
    camera: str
    camera_reason: str
    width: int
    height: int
    data_window: tuple[int, int, int, int] | None
    projection: str
    lens_radius: float
    exposure: float
    color_space: str
    purposes: list[str]
    up_axis: str
    meters_per_unit: float
    meshes: int
    triangles: int
    triangles_instanced: int
    prototypes: int
    instances: int
    materials: list[str]
    media: list[str]
    volumes: list[str]  # bodies without a surface
    world_medium: str | None
    lights: list[tuple[str, str]]  # (family, name)
    textures: list[tuple[str, int, int]]  # (file, width, height)
    texture_bytes: int
    warnings: list[Warning] = field(default_factory=list)


def inspect(stage: Usd.Stage | str | os.PathLike[str], **options) -> Inspection:
    """Read a stage as :func:`usdmlt.load` does, with the same options, and say what is in it.

    Nothing is logged: the warnings are in the result. ``strict`` is not an option.
    """
    report = Report()
    reading = read_stage(report, stage, LoadOptions(**options))
    return summarize(reading, report)


def summarize(reading: Reading, report: Report) -> Inspection:
    """The inspection of what was read with ``report``."""
    scene, window = reading.scene, reading.scene.metadata.get("data_window")
    per_prototype = [sum(len(m.triangles) for m in p.meshes) for p in scene.prototypes]
    single = sum(len(mesh.triangles) for mesh in scene.meshes)
    placed = sum(len(i.transforms) * per_prototype[i.prototype] for i in scene.instances)
    files = {t.name: (t.pixels.shape[1], t.pixels.shape[0]) for t in scene.textures}
    arrays = {id(t.pixels): t.pixels.nbytes for t in scene.textures}
    metadata, world = scene.metadata, scene.world_medium
    return Inspection(
        stage=str(metadata["stage"]),
        frame=metadata["frame"],
        prims=count_prims(reading.stage),
        render_settings=reading.settings.path,
        settings={name: value for name, value in scene.settings.items() if name != "aovs"},
        layers=[(layer.name, layer.shows) for layer in scene.settings.get("aovs", ())],
        products=[(product.path, product.name) for product in reading.settings.products],
        camera=scene.camera.name,
        camera_reason=reading.camera_reason,
        width=scene.width,
        height=scene.height,
        data_window=window and (window.x, window.y, window.full_width, window.full_height),
        projection=scene.camera.projection,
        lens_radius=scene.camera.lens_radius,
        exposure=scene.camera.exposure,
        color_space=scene.color_space,
        purposes=list(metadata["purposes"]),
        up_axis=str(metadata["up_axis"]),
        meters_per_unit=float(metadata["meters_per_unit"]),
        meshes=len(scene.meshes) + sum(len(p.meshes) for p in scene.prototypes),
        triangles=single + sum(per_prototype),
        triangles_instanced=single + placed,
        prototypes=len(scene.prototypes),
        instances=sum(len(i.transforms) for i in scene.instances),
        materials=[material.name for material in scene.materials],
        media=[medium.name for medium in scene.media],
        volumes=[volume.name for volume in scene.volumes],
        world_medium=None if world is None else scene.media[world].name,
        lights=[(type(light).__name__, light.name) for light in scene.lights],
        textures=[(name, *size) for name, size in files.items()],
        texture_bytes=sum(arrays.values()),
        warnings=report.warnings,
    )
