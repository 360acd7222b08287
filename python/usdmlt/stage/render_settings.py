"""UsdRenderSettings: the camera, the size and the purposes that a stage asks for."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Sdf, Usd, UsdRender

from usdmlt.errors import Error, Report


@dataclass
class RenderSettings:
    """What a RenderSettings prim says, or its defaults. None: not authored."""

    path: str | None = None
    camera: Sdf.Path | None = None
    resolution: tuple[int, int] | None = None
    pixel_aspect_ratio: float = 1.0
    conform_policy: str = "expandAperture"
    purposes: tuple[str, ...] | None = None
    material_purpose: str = "full"


def read_render_settings(stage: Usd.Stage, time: Usd.TimeCode, report: Report) -> RenderSettings:
    """The settings named by the stage's ``renderSettingsPrimPath``, or the first there are."""
    prim = _find(stage, report)
    if prim is None:
        return RenderSettings()
    settings = UsdRender.Settings(prim)
    result = RenderSettings(path=str(prim.GetPath()))

    targets = settings.GetCameraRel().GetForwardedTargets()
    result.camera = targets[0] if targets else None
    if settings.GetResolutionAttr().HasAuthoredValue():
        width, height = settings.GetResolutionAttr().Get(time)
        if width < 1 or height < 1:
            raise Error(f"{prim.GetPath()}: resolution is {width} x {height}")
        result.resolution = (int(width), int(height))
    result.pixel_aspect_ratio = float(settings.GetPixelAspectRatioAttr().Get(time))
    if not result.pixel_aspect_ratio > 0:
        raise Error(f"{prim.GetPath()}: pixelAspectRatio is {result.pixel_aspect_ratio:g}")
    result.conform_policy = str(settings.GetAspectRatioConformPolicyAttr().Get(time))
    if settings.GetIncludedPurposesAttr().HasAuthoredValue():
        result.purposes = tuple(str(p) for p in settings.GetIncludedPurposesAttr().Get(time))
    materials = settings.GetMaterialBindingPurposesAttr().Get(time)
    if materials is not None and len(materials):
        result.material_purpose = str(materials[0])
    window = settings.GetDataWindowNDCAttr().Get(time)
    if window is not None and tuple(window) != (0.0, 0.0, 1.0, 1.0):
        report.warn("data windows are ignored: the whole image is rendered", prim.GetPath())
    return result


def _find(stage: Usd.Stage, report: Report) -> Usd.Prim | None:
    if stage.HasAuthoredMetadata("renderSettingsPrimPath"):
        path = stage.GetMetadata("renderSettingsPrimPath")
        prim = stage.GetPrimAtPath(path) if path else None
        if prim and prim.IsA(UsdRender.Settings):
            return prim
        if path:
            report.warn("renderSettingsPrimPath names no RenderSettings", path)
    # Settings are kept below /Render by convention; look there before walking the whole stage.
    for root in (stage.GetPrimAtPath("/Render"), stage.GetPseudoRoot()):
        for prim in Usd.PrimRange(root) if root else ():
            if prim.GetTypeName() == "RenderSettings":
                return prim
    return None
