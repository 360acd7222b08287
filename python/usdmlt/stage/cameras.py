"""Which camera is rendered, and UsdGeomCamera."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils

from usdmlt.errors import Error, Report
from usdmlt.scene import Camera
from usdmlt.stage.attributes import of_type
from usdmlt.stage.motion import Shutter, every, fewest_steps
from usdmlt.stage.numbers import finite_number
from usdmlt.stage.render_settings import RenderSettings
from usdmlt.stage.transforms import singular

DEFAULT_WIDTH = 960  # pixels, as usdrecord
GF_UNIT = 0.1  # focal length and apertures are in tenths of a scene unit


def find_camera(
    stage: Usd.Stage, name: str | None, settings: RenderSettings, report: Report
) -> tuple[UsdGeom.Camera | None, str]:
    """The camera to render, and why: the one asked for by path or name, else that of the render
    settings, else the primary camera (``main_cam``), else the only one. None: frame everything.

    Raises :class:`Error`, with the cameras there are, if the one asked for does not exist.
    """
    if name is not None:
        return _named(stage, name), "asked for"
    if settings.camera is not None:
        camera = UsdGeom.Camera(stage.GetPrimAtPath(settings.camera))
        if camera:
            return camera, f"camera of {settings.path}"
        report.warn("the render settings' camera does not exist", settings.camera)
    cameras = all_cameras(stage)
    primary = [c for c in cameras if c.GetPrim().GetName() == UsdUtils.GetPrimaryCameraName()]
    if primary:
        return primary[0], "the primary camera"
    if len(cameras) == 1:
        return cameras[0], "the only camera"
    if cameras:
        paths = ", ".join(str(camera.GetPath()) for camera in cameras[:10])
        return None, f"frames everything, as none of several cameras was asked for ({paths})"
    return None, "frames everything, as the stage has no camera"


def all_cameras(stage: Usd.Stage) -> list[UsdGeom.Camera]:
    """Every active camera of a stage."""
    inside = (prim for root in stage.GetPrototypes() for prim in Usd.PrimRange(root))
    if any(of_type(inside, UsdGeom.Camera)):
        prims = stage.Traverse(Usd.TraverseInstanceProxies())
    else:
        prims = stage.Traverse()
    return [UsdGeom.Camera(prim) for prim in of_type(prims, UsdGeom.Camera)]


def _named(stage: Usd.Stage, name: str) -> UsdGeom.Camera:
    if name.startswith("/"):
        valid = Sdf.Path.IsValidPathString(name)
        camera = UsdGeom.Camera(stage.GetPrimAtPath(name)) if valid else None
        found = [camera] if camera else []
    else:
        found = [
            c
            for c in all_cameras(stage)
            if c.GetPrim().GetName() == name or str(c.GetPath()).endswith("/" + name)
        ]
    if len(found) == 1:
        return found[0]
    known = [str(camera.GetPath()) for camera in found or all_cameras(stage)]
    listed = ", ".join(known[:20]) + (", …" if len(known) > 20 else "")
    if found:
        raise Error(f"{name}: several cameras have that name: {listed}")
    raise Error(f"{name}: no such camera; " + (f"there are {listed}" if known else "there is none"))


def read_camera(
    camera: UsdGeom.Camera,
    time: Usd.TimeCode,
    report: Report,
    settings: RenderSettings | None = None,
    shutter: Shutter | None = None,
) -> Camera:
    """A UsdGeomCamera. The lens radius is focalLength / (2 fStop), in tenths of a scene unit;
    an fStop of 0, and settings that disable depth of field, make a pinhole."""
    settings = settings or RenderSettings()
    path = camera.GetPath()
    transform = UsdGeom.XformCache(time).GetLocalToWorldTransform(camera.GetPrim())
    if singular(np.array(transform)):
        raise Error(f"{path}: the camera's transform is singular")

    def number(attribute: Usd.Attribute) -> float:
        return finite_number(camera.GetPrim(), attribute.GetName(), attribute.Get(time))

    focal_length = GF_UNIT * number(camera.GetFocalLengthAttr())
    width = GF_UNIT * number(camera.GetHorizontalApertureAttr())
    height = GF_UNIT * number(camera.GetVerticalApertureAttr())
    shift_x = GF_UNIT * number(camera.GetHorizontalApertureOffsetAttr())
    shift_y = GF_UNIT * number(camera.GetVerticalApertureOffsetAttr())
    if not (width > 0 and height > 0):
        raise Error(f"{path}: the camera's apertures must be positive")
    orthographic = camera.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic
    if not orthographic and not focal_length > 0:
        raise Error(f"{path}: the camera's focalLength must be positive")
    scale = 1.0 if orthographic else 1 / focal_length
    window = (
        (shift_x - width / 2) * scale,
        (shift_x + width / 2) * scale,
        (shift_y - height / 2) * scale,
        (shift_y + height / 2) * scale,
    )
    # In the core's precision too: an offset may leave nothing of an aperture.
    left, right, bottom, top = np.array(window, dtype=np.float32)
    if not (right > left and top > bottom and np.isfinite([right, top]).all()):
        raise Error(f"{path}: the camera's apertures are nothing beside their offsets")

    f_stop = number(camera.GetFStopAttr())
    focus_distance = number(camera.GetFocusDistanceAttr())
    radius = 0.0 if orthographic or f_stop <= 0 else focal_length / (2 * f_stop)
    if not settings.depth_of_field:
        radius = 0.0
    if radius > 0 and not focus_distance > 0:
        report.note("cameras with an fStop but no focusDistance are in focus everywhere", path)
        radius = 0.0
    near, far = camera.GetClippingRangeAttr().Get(time)
    if not (math.isfinite(near) and far > near):
        report.warn("clipping ranges that are empty are ignored", path)
        near, far = 0.0, math.inf
    _warn_of_back_plates(camera, report)
    poses = [rigid(transform)]
    if shutter is not None and shutter.opens:
        poses = _poses(camera, shutter) or poses
    return Camera(
        transform=poses[0],
        motion=poses[1:],
        projection="orthographic" if orthographic else "perspective",
        window=window,
        lens_radius=radius,
        focus_distance=focus_distance if focus_distance > 0 else 1.0,
        clipping=(float(near), float(far)),
        clipping_planes=_clipping_planes(camera, time),
        exposure=_exposure(camera, time),
        name=str(path),
    )


def _poses(camera: UsdGeom.Camera, shutter: Shutter) -> list[np.ndarray]:
    """Where the camera is while its shutter is open, in as few steps as needed; empty if it stays.
    Its lens and apertures are those of the frame."""
    prim = camera.GetPrim()
    caches = [UsdGeom.XformCache(code) for code in shutter.codes]
    transforms = [cache.GetLocalToWorldTransform(prim) for cache in caches]
    if singular(np.array(transforms)).any():
        raise Error(f"{prim.GetPath()}: the camera's transform is singular")
    poses = np.array([rigid(transform) for transform in transforms])
    count = fewest_steps(poses)
    return list(every(poses, count)) if count else []


def _warn_of_back_plates(camera: UsdGeom.Camera, report: Report) -> None:
    """Of the plates that the camera would see. USD before 26 does not know their schema."""
    prim = camera.GetPrim()
    for schema in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
        name, _, plate = schema.partition(":")
        visibility = prim.GetAttribute(f"backPlate:{plate}:plateVisibility")
        if name == "BackPlateAPI" and not (visibility and visibility.Get() == "mute"):
            report.warn("back plates of cameras are not rendered", f"{prim.GetPath()} ({plate})")


def _clipping_planes(camera: UsdGeom.Camera, time: Usd.TimeCode) -> np.ndarray:
    """(n, 4): a, b, c, d of each; what has a x + b y + c z + d < 0 in the camera's space is cut
    off."""
    planes = np.array(camera.GetClippingPlanesAttr().Get(time) or (), dtype=np.float64)
    if not np.isfinite(planes).all():
        raise Error(f"{camera.GetPath()}: clippingPlanes are not finite")
    return planes.reshape(-1, 4)


def rigid(transform: Gf.Matrix4d) -> np.ndarray:
    """Position and orientation alone, (4, 4), as GfFrustum takes them: lens and distances are in
    world units whatever a camera is scaled by, and a mirrored camera has its x axis turned back."""
    if not transform.IsRightHanded():
        transform = Gf.Matrix4d(Gf.Vec4d(-1, 1, 1, 1)) * transform
    return np.array(transform.GetOrthonormalized(False), dtype=np.float64)


def _exposure(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    scale = exposure_scale(camera, time)
    if not 0 <= scale < np.finfo(np.float32).max:
        raise Error(f"{camera.GetPath()}: the camera's exposure scales the picture by {scale:g}")
    return scale


def exposure_scale(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    """The factor on the image: responsivity · time · (iso / 100) · 2^exposure / fStop²
    (UsdGeomCamera, exposure attributes)."""
    if hasattr(camera, "ComputeLinearExposureScale"):
        return float(camera.ComputeLinearExposureScale(time))

    def value(name: str, default: float) -> float:
        attribute = camera.GetPrim().GetAttribute(name)
        authored = attribute.Get(time) if attribute else None
        return default if authored is None else float(authored)

    return (
        value("exposure:responsivity", 1.0)
        * value("exposure:time", 1.0)
        * (value("exposure:iso", 100.0) / 100)
        * 2 ** value("exposure", 0.0)
        / value("exposure:fStop", 1.0) ** 2
    )


# ---------------------------------------------------------------------------------------------
# Size of the image


def resolve_size(
    camera: Camera, settings: RenderSettings, width: int | None, height: int | None
) -> tuple[int, int]:
    """Pixels of the image: as asked for, else the render settings', else 960 wide.

    With one of them asked for, the other follows from the aspect of the settings' resolution, or
    else of the camera; usdrecord truncates it.
    """
    if width is not None and height is not None:
        return width, height
    if settings.resolution is not None:
        aspect = settings.resolution[0] / settings.resolution[1]
        if width is None and height is None:
            return settings.resolution
    else:
        left, right, bottom, top = camera.window
        aspect = (right - left) / (top - bottom) / settings.pixel_aspect_ratio
    if height is not None:
        return max(1, int(height * aspect + 1e-6)), height
    width = DEFAULT_WIDTH if width is None else width
    return width, max(1, int(width / aspect + 1e-6))


def conformed(camera: Camera, settings: RenderSettings, width: int, height: int) -> Camera:
    """The camera with its window fitted to the image's aspect (UsdRenderSettingsBase,
    aspectRatioConformPolicy), about the window's centre."""
    left, right, bottom, top = camera.window
    wide, high = right - left, top - bottom
    target = settings.pixel_aspect_ratio * width / height
    policy = settings.conform_policy
    if policy == "adjustPixelAspectRatio" or math.isclose(target, wide / high, rel_tol=1e-9):
        return camera
    wider = target > wide / high
    adjusts_width = {
        "adjustApertureWidth": True,
        "adjustApertureHeight": False,
        "cropAperture": not wider,
    }.get(policy, wider)
    if adjusts_width:
        wide = high * target
    else:
        high = wide / target
    x, y = (left + right) / 2, (bottom + top) / 2
    return replace(camera, window=(x - wide / 2, x + wide / 2, y - high / 2, y + high / 2))
