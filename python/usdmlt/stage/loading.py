"""A USD stage into the scene description, from opening it to the last texture."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Report, UsageError
from usdmlt.making import kept_options
from usdmlt.options import LoadOptions
from usdmlt.scene import Camera, Scene
from usdmlt.stage.bodies import fill, fill_glass, glows, set_priorities
from usdmlt.stage.cameras import all_cameras, conformed, find_camera, read_camera, resolve_size
from usdmlt.stage.color import DEFAULT, ColorSpaces
from usdmlt.stage.data_window import data_window, windowed
from usdmlt.stage.detail import Detail
from usdmlt.stage.draw_modes import StandIns
from usdmlt.stage.flattening import flatten
from usdmlt.stage.framing import Bounds, framing_camera, scene_bounds, stage_bounds
from usdmlt.stage.geometry import GeometryReader
from usdmlt.stage.instancing import collect_groups
from usdmlt.stage.lights import LightReader, default_dome
from usdmlt.stage.materials import Materials, emits
from usdmlt.stage.mesh_lights import MeshLights
from usdmlt.stage.motion import Shutter, read_shutter
from usdmlt.stage.mtlx_files import with_mtlx_files
from usdmlt.stage.networks import Networks
from usdmlt.stage.opening import open_stage, time_code, usd_diagnostics
from usdmlt.stage.overlaps import note_overlaps
from usdmlt.stage.reading_progress import ReadingProgress, Tally
from usdmlt.stage.render_passes import PassVisibility
from usdmlt.stage.render_settings import Product, RenderSettings, read_render_settings
from usdmlt.stage.sides import apply_sides
from usdmlt.stage.skinning import Skinning
from usdmlt.stage.texture_memory import limit_textures
from usdmlt.stage.textures import Textures
from usdmlt.stage.traversal import Traversal
from usdmlt.stage.value_types import mistyped_values_named
from usdmlt.stage.volumes import VolumeReader
from usdmlt.stage.world_medium import read_world_medium, warn_of_lost_light

PURPOSES = ("default", "render")
UNIT_BOX = (np.full(3, -0.5), np.full(3, 0.5))  # framed where there is nothing


def load(
    stage: Usd.Stage | str | os.PathLike[str],
    *,
    progress: ReadingProgress | None = None,
    **options: Any,
) -> Scene:
    """Read a USD stage into a :class:`usdmlt.Scene`.

    ``stage``: an open stage, which is not changed, or the path of a file. ``options``: the fields
    of :class:`usdmlt.options.LoadOptions`: camera, frame, width, height, crop, purposes, mask,
    session_layer, variants, overrides, render_settings, render_pass, product, complexity,
    double_sided, draw_modes, default_light, domes_visible, texture_memory, search_paths, resolver,
    primvars, color_space and strict. ``progress`` is called about ten times a second with the
    number of prims of geometry that are read, and of all there are.

    Content that is not supported is left out, with one warning per kind on the ``usdmlt`` logger;
    with ``strict`` it raises instead. Raises :class:`usdmlt.Error`, with the prim path or the file,
    for what is broken or missing, and ValueError for values out of range.

    >>> scene = usdmlt.load("shot.usda", camera="/cameras/main", frame=101, width=640)
    >>> len(scene.meshes), len(scene.lights)
    (12, 2)
    """
    asked = LoadOptions(**options)
    report = Report(asked.strict)
    reading = read_stage(report, stage, asked, progress)
    report.log()
    return reading.scene


def camera_paths(stage: Usd.Stage | str | os.PathLike[str], **options: Any) -> list[str]:
    """The paths of a stage's cameras; options as of :func:`load`."""
    asked = LoadOptions(**options)
    with usd_diagnostics(Report()):
        cameras = all_cameras(open_stage(stage, asked))
    return [str(camera.GetPath()) for camera in cameras]


def products(stage: Usd.Stage | str | os.PathLike[str], **options: Any) -> list[Product]:
    """The raster products of a stage's render settings; options as of :func:`load`."""
    asked, report = LoadOptions(**options), Report()
    with usd_diagnostics(report):
        opened = open_stage(stage, asked)
        time = time_code(opened, asked.frame)
        with mistyped_values_named(opened, time):
            return read_render_settings(opened, time, report, asked).products


@dataclass
class Reading:
    """What was read, and how the choices fell."""

    scene: Scene
    camera_reason: str
    settings: RenderSettings
    stage: Usd.Stage


def read_stage(
    report: Report,
    stage: Usd.Stage | str | os.PathLike[str],
    options: LoadOptions,
    progress: ReadingProgress | None = None,
) -> Reading:
    """As :func:`load`, with the warnings left in ``report``."""
    with usd_diagnostics(report):
        opened = with_mtlx_files(open_stage(stage, options), report)
        time = time_code(opened, options.frame)
        with mistyped_values_named(opened, time):
            settings = read_render_settings(opened, time, report, options)
            colors = _color_spaces(options, settings, report)
            shown = _purposes(options, settings)
            skinning = Skinning(time)
            found, reason = find_camera(opened, options.camera, settings, report)
            shutter = read_shutter(found, time, settings.motion_blur, report)
            lens = None if found is None else read_camera(found, time, report, settings, shutter)
            bounds = cache(lambda: stage_bounds(opened, time, shown))
            scene = _read_content(
                opened,
                time,
                shown,
                options,
                settings,
                lens,
                bounds,
                colors,
                skinning,
                shutter,
                report,
                progress,
            )
            limit_textures(scene.textures, options.texture_memory, report)
            scene.camera = lens or _frame_everything(opened, bounds, scene, skinning)
            _fit_picture(scene, options, settings)
            scene.settings = settings.usdmlt
            scene.metadata |= _metadata(opened, time, settings, shown)
            if not isinstance(stage, Usd.Stage):
                scene.metadata["options"] = kept_options(options)
    return Reading(scene, reason, settings, opened)


def _fit_picture(scene: Scene, options: LoadOptions, settings: RenderSettings) -> None:
    """The size of the picture, and the camera that fills it, or its data window."""
    width, height = resolve_size(scene.camera, settings, options.width, options.height)
    scene.camera = conformed(scene.camera, settings, width, height)
    window = data_window(options.crop or settings.data_window, width, height)
    if (window.x, window.y, window.width, window.height) != (0, 0, width, height):
        scene.camera = windowed(scene.camera, window)
        scene.metadata["data_window"] = window
    scene.width, scene.height = window.width, window.height


def _color_spaces(options: LoadOptions, settings: RenderSettings, report: Report) -> ColorSpaces:
    """Into the space asked for, else that of the render settings, else linear Rec.709."""
    if options.color_space is not None or settings.color_space is None:
        return ColorSpaces(options.color_space or DEFAULT, report)
    try:
        return ColorSpaces(settings.color_space, report)
    except UsageError as error:
        report.warn(f"renderingColorSpace counts as {DEFAULT}: {error}", settings.path or "")
        return ColorSpaces(DEFAULT, report)


def _read_content(
    stage: Usd.Stage,
    time: Usd.TimeCode,
    purposes: tuple[str, ...],
    options: LoadOptions,
    settings: RenderSettings,
    camera: Camera | None,
    bounds: Callable[[], Bounds | None],
    colors: ColorSpaces,
    skinning: Skinning,
    shutter: Shutter,
    report: Report,
    progress: ReadingProgress | None,
) -> Scene:
    """Geometry, materials, textures and lights; ``camera`` None: the one that frames them all, that
    is, the authored ``bounds``."""
    textures = Textures(time, colors, report)
    materials = Materials(Networks(time, colors, textures, report), report)
    visibility = PassVisibility(settings.render_pass, report)
    traversal = Traversal(time, purposes, skinning, report, options.draw_modes, visibility, shutter)
    groups, links = collect_groups(stage, traversal, colors, settings.material_purpose, report)
    detail = _detail(stage, bounds, options, settings, camera)
    stand_ins = StandIns(time, purposes, colors, materials, report)
    geometry = GeometryReader(
        time,
        colors,
        materials,
        settings.material_purpose,
        skinning,
        stand_ins,
        detail,
        shutter,
        report,
        _primvars_of_layers(options, settings),
    )
    up_axis = str(UsdGeom.GetStageUpAxis(stage))
    lights = LightReader(time, colors, textures, report, up_axis)
    mesh_lights = MeshLights(
        materials.materials, settings.material_purpose, lights.mesh_radiance, report
    )
    volumes = VolumeReader(time, colors, materials, settings.material_purpose, report)
    tally = Tally(sum(len(group.gprims) for group in groups), progress)
    for group in groups:
        group.scene_meshes = geometry.read(group, tally)
        fill(group, materials, report)
        if (options.double_sided or settings.loading.get("double_sided")) == "auto":
            apply_sides(group, materials.materials)
        mesh_lights.apply(group)
        group.scene_volumes += volumes.read(group)
        group.scene_lights = [lights.read(p.prim, p.kind, p.matrix) for p in group.lights]
        links.apply(group)

    world_medium = read_world_medium(stage, settings, materials, report)
    fill_glass(groups, materials)
    set_priorities(groups)
    flat = flatten(groups, materials, report)
    note_overlaps([m for m in flat.meshes if m.medium is not None] + flat.volumes, report)
    placed_lights = flat.lights
    glowing = any(map(emits, materials.materials)) or any(map(glows, materials.media))
    lit = placed_lights or glowing
    if not lit and options.default_light:
        report.note("the stage has no lights: a white dome lights it")
        placed_lights.append(default_dome())
    elif not lit:
        report.note("the stage has no lights: the picture is black")
    if world_medium is not None:
        warn_of_lost_light(materials.media[world_medium], placed_lights, report)
    return Scene(
        background=bool(lit)
        and options.domes_visible,  # white objects before a white dome could not be seen
        meshes=flat.meshes,
        prototypes=flat.prototypes,
        instances=flat.instances,
        materials=materials.materials,
        textures=textures.textures,
        lights=placed_lights,
        media=materials.media,
        volumes=flat.volumes,
        world_medium=world_medium,
        color_space=colors.rendering,
    )


def _primvars_of_layers(options: LoadOptions, settings: RenderSettings) -> frozenset[str]:
    """What layers read beside what materials do."""
    asked = (layer.primvar for layer in settings.usdmlt.get("aovs", ()))
    return frozenset(name for name in (*options.primvars, *asked) if name)


def _detail(
    stage: Usd.Stage,
    bounds: Callable[[], Bounds | None],
    options: LoadOptions,
    settings: RenderSettings,
    camera: Camera | None,
) -> Detail:
    """How fine curved surfaces have to be. Without a camera it is the one that frames the authored
    bounds, which USD computes safely only once the instancers are known to be sound."""
    if camera is None:
        camera = framing_camera(bounds() or UNIT_BOX, str(UsdGeom.GetStageUpAxis(stage)))
    width, height = resolve_size(camera, settings, options.width, options.height)
    return Detail.of(options.complexity, conformed(camera, settings, width, height), width)


def _frame_everything(
    stage: Usd.Stage,
    bounds: Callable[[], Bounds | None],
    scene: Scene,
    skinning: Skinning,
) -> Camera:
    """The camera of a stage without one: frames the authored bounds, or, where they are empty or
    wrong, what was read. Skinned meshes are where they were read: USD bounds their joints only."""
    box = None if skinning.has_skins else bounds()
    if box is None:
        box = scene_bounds(scene.meshes, scene.prototypes, scene.instances)
    return framing_camera(box or UNIT_BOX, str(UsdGeom.GetStageUpAxis(stage)))


def _metadata(
    stage: Usd.Stage, time: Usd.TimeCode, settings: RenderSettings, purposes: tuple[str, ...]
) -> dict[str, object]:
    root = stage.GetRootLayer()
    return {
        "stage": root.realPath or root.identifier,
        "frame": time.GetValue() if time.IsNumeric() and not time.IsEarliestTime() else None,
        "up_axis": str(UsdGeom.GetStageUpAxis(stage)),
        "meters_per_unit": float(UsdGeom.GetStageMetersPerUnit(stage)),
        "frames_per_second": float(stage.GetFramesPerSecond()),
        "render_settings": settings.path,
        "product": settings.product,
        "purposes": list(purposes),
    }


def _purposes(options: LoadOptions, settings: RenderSettings) -> tuple[str, ...]:
    """The purposes that are rendered, "default" among them."""
    asked = options.purposes
    if asked is None:
        asked = PURPOSES if settings.purposes is None else settings.purposes
    return tuple(dict.fromkeys(["default", *asked]))
