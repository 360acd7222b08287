"""UsdRender: what the settings, products, vars and passes of a stage ask for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf, Usd, UsdRender

from usdmlt.errors import Error, Report, UsageError
from usdmlt.options import KNOWN_PURPOSES, LoadOptions, check_data_window
from usdmlt.stage.data_window import WHOLE
from usdmlt.stage.render_vars import read_render_vars
from usdmlt.stage.usdmlt_settings import WORLD_MEDIUM, read_usdmlt_settings

CONFORM_POLICIES = (
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
)


@dataclass(frozen=True)
class Product:
    """A picture file that the settings ask for."""

    path: str
    name: str  # of the file

    @property
    def prim_name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition("/")[2]


@dataclass
class RenderSettings:
    """What a RenderSettings prim and its product say, or the defaults. None: not authored."""

    path: str | None = None
    camera: Sdf.Path | None = None
    resolution: tuple[int, int] | None = None
    pixel_aspect_ratio: float = 1.0
    conform_policy: str = "expandAperture"
    data_window: tuple[float, float, float, float] = WHOLE
    depth_of_field: bool = True
    motion_blur: bool = True
    purposes: tuple[str, ...] | None = None
    material_purpose: str = "full"
    color_space: str | None = None
    products: list[Product] = field(default_factory=list)
    product: str | None = None  # the one whose opinions count
    render_pass: Usd.Prim | None = None
    usdmlt: dict[str, Any] = field(default_factory=dict)  # fields of usdmlt.Settings
    loading: dict[str, Any] = field(default_factory=dict)  # fields of LoadOptions
    world_medium: Sdf.Path | None = None  # a material's


def read_render_settings(
    stage: Usd.Stage, time: Usd.TimeCode, report: Report, options: LoadOptions | None = None
) -> RenderSettings:
    """The settings that the options name, else those of the stage's ``renderSettingsPrimPath``,
    else the first there are, with the opinions of one product over them."""
    options = options or LoadOptions()
    render_pass = _pass(stage, options)
    prim = _find(stage, options, render_pass, report)
    result = RenderSettings(render_pass=render_pass)
    if prim is None:
        if options.product is not None:
            raise Error(f"{options.product}: no such product; the stage has no render settings")
        return result
    settings = UsdRender.Settings(prim)
    result.path = str(prim.GetPath())
    result.products = _products(settings, time, report)
    product = _chosen_product(stage, options, result)
    bases = [UsdRender.SettingsBase(product)] if product else []
    bases.append(UsdRender.SettingsBase(prim))
    _read_base(result, bases, time, report)

    if settings.GetIncludedPurposesAttr().HasAuthoredValue():
        purposes = tuple(str(p) for p in settings.GetIncludedPurposesAttr().Get(time) or ())
        unknown = set(purposes) - set(KNOWN_PURPOSES)
        if unknown:
            raise Error(f"{result.path}: unknown purposes: {', '.join(sorted(unknown))}")
        result.purposes = purposes
    materials = settings.GetMaterialBindingPurposesAttr().Get(time)
    if materials is not None and len(materials):
        # Files have "allPurpose" for the empty token that means it.
        purposes = [str(p).replace("allPurpose", "") for p in materials]
        result.material_purpose = purposes[0]
        if any(purposes[1:]):
            report.warn("of several material purposes the first and all-purpose count", result.path)
    space = settings.GetRenderingColorSpaceAttr().Get(time)
    result.color_space = str(space) if space else None
    result.usdmlt, result.loading = read_usdmlt_settings(prim, time, report)
    targets = prim.GetRelationship(WORLD_MEDIUM).GetForwardedTargets()
    result.world_medium = targets[0] if targets else None
    if product:
        aovs = read_render_vars(UsdRender.Product(product), time, report)
        if aovs:
            result.usdmlt["aovs"] = aovs
    return result


def _read_base(
    result: RenderSettings,
    bases: list[UsdRender.SettingsBase],
    time: Usd.TimeCode,
    report: Report,
) -> None:
    """What settings and products have in common; the first base has the strongest opinion."""

    def value(name: str):
        for base in bases:
            attribute = base.GetPrim().GetAttribute(name)
            if attribute and attribute.HasAuthoredValue():
                return attribute.Get(time), base.GetPath()
        return None, bases[-1].GetPath()

    for base in bases:
        targets = base.GetCameraRel().GetForwardedTargets()
        if targets and result.camera is None:
            result.camera = targets[0]
    resolution, path = value("resolution")
    if resolution is not None:
        if min(resolution) < 1:
            raise Error(f"{path}: resolution is {resolution[0]} x {resolution[1]}")
        result.resolution = (int(resolution[0]), int(resolution[1]))
    aspect, path = value("pixelAspectRatio")
    if aspect is not None:
        result.pixel_aspect_ratio = float(aspect)
        if not result.pixel_aspect_ratio > 0:
            raise Error(f"{path}: pixelAspectRatio is {aspect:g}")
    policy, path = value("aspectRatioConformPolicy")
    if policy is not None:
        if policy in CONFORM_POLICIES:
            result.conform_policy = str(policy)
        else:
            report.warn(f"unknown aspectRatioConformPolicy {policy!r}, expandAperture counts", path)
    window, path = value("dataWindowNDC")
    if window is not None:
        try:
            check_data_window("dataWindowNDC", tuple(window))
        except UsageError as error:
            raise Error(f"{path}: {error}") from None
        result.data_window = tuple(float(edge) for edge in window)
    result.depth_of_field = not value("disableDepthOfField")[0]
    result.motion_blur = not (value("disableMotionBlur")[0] or value("instantaneousShutter")[0])


# ---------------------------------------------------------------------------------------------
# Finding the prims


def _find(
    stage: Usd.Stage, options: LoadOptions, render_pass: Usd.Prim | None, report: Report
) -> Usd.Prim | None:
    if options.render_settings is not None:
        return _required(stage, options.render_settings, UsdRender.Settings, "RenderSettings")
    if render_pass is not None:
        targets = UsdRender.Pass(render_pass).GetRenderSourceRel().GetForwardedTargets()
        prim = stage.GetPrimAtPath(targets[0]) if targets else None
        if not prim or not prim.IsA(UsdRender.Settings):
            raise Error(f"{render_pass.GetPath()}: its renderSource names no RenderSettings")
        return prim
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


def _pass(stage: Usd.Stage, options: LoadOptions) -> Usd.Prim | None:
    if options.render_pass is None:
        return None
    return _required(stage, options.render_pass, UsdRender.Pass, "RenderPass")


def _required(stage: Usd.Stage, path: str, schema: type, name: str) -> Usd.Prim:
    """The prim of a type at a path; :class:`Error`, with those there are, if it is none."""
    valid = Sdf.Path.IsValidPathString(path) and path.startswith("/")
    prim = stage.GetPrimAtPath(path) if valid else None
    if prim and prim.IsA(schema):
        return prim
    known = [str(p.GetPath()) for p in stage.Traverse() if p.IsA(schema)]
    raise Error(
        f"{path}: no such {name}; "
        + (f"there are {', '.join(known[:20])}" if known else "there is none")
    )


def _products(settings: UsdRender.Settings, time: Usd.TimeCode, report: Report) -> list[Product]:
    """The raster products. A product without a name is named as its prim (arnold-usd)."""
    stage, products = settings.GetPrim().GetStage(), []
    for target in settings.GetProductsRel().GetForwardedTargets():
        prim = stage.GetPrimAtPath(target)
        if not prim or not prim.IsA(UsdRender.Product):
            report.warn("products of the render settings do not exist", target)
            continue
        product = UsdRender.Product(prim)
        kind = product.GetProductTypeAttr().Get(time)
        if kind not in (None, "", "raster"):
            report.warn("products other than raster ones are not made", f"{target} ({kind})")
            continue
        name = product.GetProductNameAttr().Get(time)
        products.append(Product(str(target), str(name) if name else f"{prim.GetName()}.exr"))
    return products


def _chosen_product(
    stage: Usd.Stage, options: LoadOptions, settings: RenderSettings
) -> Usd.Prim | None:
    paths = [product.path for product in settings.products]
    if options.product is not None and options.product not in paths:
        there = f"there are {', '.join(paths)}" if paths else "there are none"
        raise Error(f"{options.product}: no raster product of {settings.path}; {there}")
    settings.product = options.product or (paths[0] if paths else None)
    return stage.GetPrimAtPath(settings.product) if settings.product else None
