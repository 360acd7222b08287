"""A USD stage into the scene description, from opening it to the last texture."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from pxr import Usd, UsdGeom

from usdmlt.errors import Report, UsageError
from usdmlt.scene import Camera, Scene
from usdmlt.stage.cameras import conformed, find_camera, read_camera, resolve_size
from usdmlt.stage.color import ColorSpaces
from usdmlt.stage.framing import framing_camera, scene_bounds, stage_bounds
from usdmlt.stage.geometry import GeometryReader
from usdmlt.stage.instancing import Instancing, flatten
from usdmlt.stage.lights import LightReader, default_dome
from usdmlt.stage.materials import Materials, emits
from usdmlt.stage.networks import Networks
from usdmlt.stage.opening import open_stage, time_code, usd_diagnostics
from usdmlt.stage.render_settings import RenderSettings, read_render_settings
from usdmlt.stage.skinning import Skinning
from usdmlt.stage.textures import Textures
from usdmlt.stage.traversal import Traversal

PURPOSES = ("default", "render")
KNOWN_PURPOSES = {"default", "render", "proxy", "guide"}


def load(
    stage: Usd.Stage | str | os.PathLike[str],
    camera: str | None = None,
    frame: float | None = None,
    width: int | None = None,
    height: int | None = None,
    purposes: Iterable[str] | None = None,
    mask: Iterable[str] | None = None,
    session_layer: str | os.PathLike[str] | None = None,
    strict: bool = False,
    color_space: str = "lin_rec709_scene",
) -> Scene:
    """Read a USD stage into a :class:`usdmlt.Scene`.

    ``stage``: an open stage, which is not changed, or the path of a file. ``camera``: prim path or
    name; None: the render settings' camera, else ``main_cam``, else the only one, else one that
    frames everything. ``frame``: time code; None: the stage's start. ``width``, ``height``: pixels;
    None: the render settings', else 960 wide with the camera's aspect. ``purposes``: which purposes
    are rendered besides "default"; None: the render settings', else "render". ``mask``: prim paths;
    only they, and what is above and below them, are read. ``session_layer``: a layer file with the
    strongest opinions. ``color_space``: the linear RGB space of the result.

    Content that is not supported is left out, with one warning per kind on the ``usdmlt`` logger;
    with ``strict`` it raises instead. Raises :class:`usdmlt.Error`, with the prim path or the file,
    for what is broken or missing, and ValueError for values out of range.

    >>> scene = usdmlt.load("shot.usda", camera="/cameras/main", frame=101, width=640)
    >>> len(scene.meshes), len(scene.lights)
    (12, 2)
    """
    report = Report(strict)
    reading = read_stage(
        report,
        stage,
        camera=camera,
        frame=frame,
        width=width,
        height=height,
        purposes=purposes,
        mask=mask,
        session_layer=session_layer,
        color_space=color_space,
    )
    report.log()
    return reading.scene


@dataclass
class Reading:
    """What was read, and how the choices fell."""

    scene: Scene
    camera_reason: str


def read_stage(
    report: Report,
    stage: Usd.Stage | str | os.PathLike[str],
    camera: str | None = None,
    frame: float | None = None,
    width: int | None = None,
    height: int | None = None,
    purposes: Iterable[str] | None = None,
    mask: Iterable[str] | None = None,
    session_layer: str | os.PathLike[str] | None = None,
    color_space: str = "lin_rec709_scene",
) -> Reading:
    """As :func:`load`, with the warnings left in ``report``."""
    _check_size("width", width)
    _check_size("height", height)
    colors = ColorSpaces(color_space, report)
    with usd_diagnostics(report):
        opened = open_stage(stage, mask, session_layer)
        time = time_code(opened, frame)
        settings = read_render_settings(opened, time, report)
        shown = _purposes(purposes, settings)
        skinning = Skinning(time)
        scene = _read_content(opened, time, shown, settings, colors, skinning, report)
        found, reason = find_camera(opened, camera, settings, report)
        if found is None:
            scene.camera = _frame_everything(opened, time, shown, scene, skinning)
        else:
            scene.camera = read_camera(found, time, report)
        scene.width, scene.height = resolve_size(scene.camera, settings, width, height)
        scene.camera = conformed(scene.camera, settings, scene.width, scene.height)
        scene.metadata = _metadata(opened, time, settings, shown)
    return Reading(scene, reason)


def _read_content(
    stage: Usd.Stage,
    time: Usd.TimeCode,
    purposes: tuple[str, ...],
    settings: RenderSettings,
    colors: ColorSpaces,
    skinning: Skinning,
    report: Report,
) -> Scene:
    """Geometry, materials, textures and lights."""
    textures = Textures(time, colors, report)
    materials = Materials(Networks(time, colors, textures, report), report)
    traversal = Traversal(time, purposes, skinning, report)
    instancing = Instancing(stage, traversal, settings.material_purpose, report)
    world = instancing.collect()
    geometry = GeometryReader(time, colors, materials, settings.material_purpose, skinning, report)
    up_axis = str(UsdGeom.GetStageUpAxis(stage))
    lights = LightReader(time, colors, textures, report, up_axis)
    for group in instancing.groups:
        group.scene_meshes = geometry.read(group)
        group.scene_lights = [lights.read(p.prim, p.kind, p.matrix) for p in group.lights]

    meshes, prototypes, instances, placed_lights = flatten(world)
    lit = placed_lights or any(emits(material) for material in materials.materials)
    if not lit:
        report.note("the stage has no lights: a white dome lights it")
        placed_lights.append(default_dome())
    return Scene(
        background=bool(lit),  # white objects before a white dome could not be seen
        meshes=meshes,
        prototypes=prototypes,
        instances=instances,
        materials=materials.materials,
        textures=textures.textures,
        lights=placed_lights,
        color_space=colors.rendering,
    )


def _frame_everything(
    stage: Usd.Stage,
    time: Usd.TimeCode,
    purposes: tuple[str, ...],
    scene: Scene,
    skinning: Skinning,
) -> Camera:
    """The camera of a stage without one: frames the authored bounds, or, where they are empty or
    wrong, what was read. Skinned meshes are where they were read: USD bounds their joints only."""
    bounds = None if skinning.has_skins else stage_bounds(stage, time, purposes)
    if bounds is None:
        bounds = scene_bounds(scene.meshes, scene.prototypes, scene.instances)
    if bounds is None:
        bounds = (np.full(3, -0.5), np.full(3, 0.5))
    return framing_camera(bounds, str(UsdGeom.GetStageUpAxis(stage)))


def _metadata(
    stage: Usd.Stage, time: Usd.TimeCode, settings: RenderSettings, purposes: tuple[str, ...]
) -> dict[str, object]:
    root = stage.GetRootLayer()
    return {
        "stage": root.realPath or root.identifier,
        "frame": None if time.IsEarliestTime() else time.GetValue(),
        "up_axis": str(UsdGeom.GetStageUpAxis(stage)),
        "meters_per_unit": float(UsdGeom.GetStageMetersPerUnit(stage)),
        "frames_per_second": float(stage.GetFramesPerSecond()),
        "render_settings": settings.path,
        "purposes": list(purposes),
    }


def _purposes(asked: Iterable[str] | None, settings: RenderSettings) -> tuple[str, ...]:
    """The purposes that are rendered, "default" among them."""
    if asked is None:
        asked = PURPOSES if settings.purposes is None else settings.purposes
    shown = dict.fromkeys(["default", *([asked] if isinstance(asked, str) else asked)])
    unknown = set(shown) - KNOWN_PURPOSES
    if unknown:
        raise UsageError(f"unknown purposes: {', '.join(sorted(unknown))}")
    return tuple(shown)


def _check_size(name: str, value: int | None) -> None:
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        raise UsageError(f"{name} must be a whole number of pixels from 1, not {value!r}")
