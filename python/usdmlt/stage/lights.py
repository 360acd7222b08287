"""UsdLux lights: size, shaping and the radiance that follows from all of a light's inputs.

L = intensity · 2^exposure · color · blackbody(colorTemperature) / (normalize ? size : 1)
(UsdLux overview; with one unit of intensity meaning one nit). Sizes are in world space, scale
included, as hdEmbree takes them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pxr import Ar, Sdf, Usd, UsdGeom, UsdLux

from usdmlt import scene
from usdmlt.errors import Error, Report
from usdmlt.stage.color import DEFAULT, ColorSpaces
from usdmlt.stage.dome_formats import LATLONG, LAYOUTS, layout, to_latlong
from usdmlt.stage.ies_profiles import Malformed, parse_ies, shaped
from usdmlt.stage.light_groups import light_group
from usdmlt.stage.light_sizes import (
    cylinder_area,
    disk_area,
    distant_size,
    rect_area,
    sphere_area,
)
from usdmlt.stage.membership import SHADOW_LINK, Collection, is_authored
from usdmlt.stage.numbers import finite_number
from usdmlt.stage.textures import Textures
from usdmlt.stage.transforms import singular

LARGEST_EXPOSURE = 100.0  # stops: beyond, no float holds what it means


class LightReader:
    """Reads lights; ``textures`` takes their images."""

    def __init__(
        self,
        time: Usd.TimeCode,
        colors: ColorSpaces,
        textures: Textures,
        report: Report,
        up_axis: str,
    ):
        self.time = time
        self.colors = colors
        self.textures = textures
        self.report = report
        self.up_axis = up_axis
        self._profiles: dict[str, scene.IesProfile | None] = {}
        self._resampled: dict[tuple[int, str], int] = {}

    def read(self, prim: Usd.Prim, kind: str, transform: np.ndarray) -> scene.Light:
        """One light of a type in :data:`READERS`. ``transform`` (4, 4): light to world.

        Raises :class:`Error` with the prim path for sizes and transforms that emit nothing.
        """
        self._warn_of_unsupported(prim, kind)
        if not np.isfinite(transform).all():
            raise Error(f"{prim.GetPath()}: the light's transform is not finite")
        if kind not in _AT_INFINITY and singular(transform):
            raise Error(f"{prim.GetPath()}: the light's transform is singular")
        light = READERS[kind](self, prim, transform)
        light.light_group = light_group(prim)
        return light

    def value(self, prim: Usd.Prim, name: str):
        """The value of ``inputs:name``, or of the plain ``name`` of files older than USD 21.02."""
        attribute = self.attribute(prim, name)
        return attribute.Get(self.time) if attribute else None

    def attribute(self, prim: Usd.Prim, name: str) -> Usd.Attribute:
        """``inputs:name``, unless only the legacy ``name`` is authored."""
        attribute = prim.GetAttribute(f"inputs:{name}")
        if attribute and attribute.HasAuthoredValue():
            return attribute
        legacy = prim.GetAttribute(name)
        return legacy if legacy and legacy.HasAuthoredValue() else attribute

    def number(self, prim: Usd.Prim, name: str) -> float:
        """A finite number."""
        return finite_number(prim, name, self.value(prim, name))

    def length(self, prim: Usd.Prim, name: str) -> float:
        """A size, which must be positive."""
        value = self.number(prim, name)
        if value <= 0:
            raise Error(f"{prim.GetPath()}: {name} of the light is {value:g}; it must be positive")
        return value

    def radius(self, prim: Usd.Prim, hint: str) -> tuple[float, bool]:
        """A radius, and whether it stands for 0.

        Area lights need not follow ``treatAsPoint`` and ``treatAsLine``; but where the radius
        that comes with them is 0, the light is a millimetre thick and as if normalized: without
        surface it would give no light otherwise.
        """
        value, treated = self.number(prim, "radius"), prim.GetAttribute(hint)
        if value == 0 and treated and treated.Get(self.time):
            meters = UsdGeom.GetStageMetersPerUnit(prim.GetStage())
            return 1e-3 / meters, True
        return self.length(prim, "radius"), False

    def radiance(self, prim: Usd.Prim, size: float = 1.0, normalized: bool = False) -> scene.Color:
        """The light's radiance in the rendering colour space; ``size``: its normalization, which
        counts where the light asks for it or ``normalized`` is set."""
        exposure = self.number(prim, "exposure")
        if exposure > LARGEST_EXPOSURE:
            raise Error(f"{prim.GetPath()}: exposure of the light is {exposure:g}")
        strength = self.number(prim, "intensity") * 2.0**exposure
        if strength < 0:
            self.report.warn("lights of negative intensity are dark", prim.GetPath())
            strength = 0.0
        if normalized or self.value(prim, "normalize"):
            strength = strength / size if size > 0 else 0.0
        # Color and blackbody multiply in Rec.709, where the blackbody is defined, so that the
        # light does not depend on the rendering space.
        attribute = self.attribute(prim, "color")
        space = self.colors.space_of(attribute)
        authored = np.array(attribute.Get(self.time), dtype=np.float64)
        rec709 = ColorSpaces(DEFAULT, self.report).convert(authored, space)
        if self.value(prim, "enableColorTemperature"):
            kelvin = self.number(prim, "colorTemperature")
            rec709 = rec709 * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
        rgb = self.colors.convert(strength * rec709, DEFAULT)
        if not (np.abs(rgb) < np.finfo(np.float32).max).all():
            raise Error(f"{prim.GetPath()}: the light's radiance is {np.abs(rgb).max():g}")
        return (float(rgb[0]), float(rgb[1]), float(rgb[2]))

    def mesh_radiance(self, prim: Usd.Prim, area: float) -> scene.Color:
        """The radiance of a mesh with MeshLightAPI; ``area``: in the world."""
        self._warn_of_unsupported(prim, "MeshLightAPI")
        self.warn_of_shaping(prim, "meshes")
        return self.radiance(prim, area)

    def shaping(self, prim: Usd.Prim) -> scene.Shaping | None:
        """Cone, focus and profile, where ShapingAPI is applied or authored."""
        names = ("focus", "focusTint", "cone:angle", "cone:softness", "ies:file")
        applied = prim.HasAPI(UsdLux.ShapingAPI)
        if not applied and not any(self._authored(prim, f"shaping:{name}") for name in names):
            return None
        default = scene.Shaping()

        def number(name: str, otherwise: float) -> float:
            value = self.value(prim, f"shaping:{name}")
            return otherwise if value is None else finite_number(prim, f"shaping:{name}", value)

        tint = self.attribute(prim, "shaping:focusTint")
        color = tint.Get(self.time) if tint else None
        return scene.Shaping(
            focus=number("focus", default.focus),
            focus_tint=default.focus_tint if color is None else self.colors.color(color, tint),
            cone_angle_degrees=number("cone:angle", default.cone_angle_degrees),
            cone_softness=number("cone:softness", default.cone_softness),
            ies=self._profile(prim, self.value(prim, "shaping:ies:file")),
        )

    def _profile(self, prim: Usd.Prim, asset: Sdf.AssetPath | None) -> scene.IesProfile | None:
        if asset is None or not asset.path:
            return None
        path = asset.resolvedPath
        if path not in self._profiles:
            try:
                self._profiles[path] = parse_ies(_read_text(path))
            except Malformed as reason:
                self._profiles[path] = None
                place = f"{prim.GetPath()} ({path or asset.path}: {reason})"
                self.report.warn("IES profiles cannot be read", place)
        profile = self._profiles[path]
        if profile is None:
            return None
        scale = self.value(prim, "shaping:ies:angleScale")
        scale = 0.0 if scale is None else finite_number(prim, "shaping:ies:angleScale", scale)
        return shaped(profile, scale, bool(self.value(prim, "shaping:ies:normalize")))

    def warn_of_shaping(self, prim: Usd.Prim, of: str = "lights at infinity") -> None:
        """Lights of some kinds are not shaped; say so where one was meant to be."""
        shaping = self.shaping(prim)
        names = ("shaping:focus", "shaping:cone:angle", "shaping:ies:file")
        authored = any(self._authored(prim, name) for name in names)
        changes = shaping and (
            shaping.focus > 0 or shaping.cone_angle_degrees < 90 or shaping.ies is not None
        )
        if authored and changes:
            self.report.warn(f"shaping of {of} is ignored", prim.GetPath())

    def texture(self, prim: Usd.Prim) -> int | None:
        """The index of the light's texture; None if it has none or it cannot be read."""
        attribute = self.attribute(prim, "texture:file")
        value = attribute.Get(self.time) if attribute else None
        if value is None or not value.path:
            return None
        return self.textures.add_light_texture(attribute, value)

    def dome_texture(self, prim: Usd.Prim) -> int | None:
        """As :meth:`texture`; images of another layout are resampled to lat-long."""
        index = self.texture(prim)
        if index is None:
            return None
        texture = self.textures.textures[index]
        height, width = texture.pixels.shape[:2]
        name = layout(self.value(prim, "texture:format"), width, height)
        if name == LATLONG:
            return index
        if name not in LAYOUTS:
            self.report.warn("dome textures are read as latlong", f"{prim.GetPath()} ({name})")
            return index
        if (index, name) not in self._resampled:
            pixels = to_latlong(texture.linear(), name)
            self._resampled[index, name] = len(self.textures.textures)
            self.textures.textures.append(
                scene.Texture(pixels, wrap_s="repeat", wrap_t="clamp", name=texture.name)
            )
        return self._resampled[index, name]

    def _authored(self, prim: Usd.Prim, name: str) -> bool:
        attribute = self.attribute(prim, name)
        return bool(attribute) and attribute.HasAuthoredValue()

    def _warn_of_unsupported(self, prim: Usd.Prim, kind: str) -> None:
        path, report = prim.GetPath(), self.report
        for name in ("diffuse", "specular"):
            value = self.value(prim, name)
            if value is not None and value != 1:
                report.warn("diffuse and specular multipliers of lights are ignored", path)
        for relationship, kind_of in (("light:filters", "filters"), ("portals", "portals")):
            if prim.GetRelationship(relationship).GetTargets():
                report.warn(f"light {kind_of} are not rendered", path)
        if is_authored(prim, SHADOW_LINK) and not Collection(prim, SHADOW_LINK).has_all:
            report.warn("shadow linking is ignored", path)
        if prim.HasAPI(UsdLux.ShadowAPI) and self.value(prim, "shadow:enable") is False:
            report.warn("lights always cast shadows", path)


def _read_text(path: str) -> str:
    """A text file, wherever USD's resolver finds it."""
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path)) if path else None
    if not asset:
        raise Malformed("there is no such file")
    with asset:
        return bytes(asset.GetBuffer()).decode("latin-1")


# ---------------------------------------------------------------------------------------------
# The families


def _rect(reader: LightReader, prim: Usd.Prim, transform: np.ndarray) -> scene.RectLight:
    width, height = reader.length(prim, "width"), reader.length(prim, "height")
    return scene.RectLight(
        radiance=reader.radiance(prim, rect_area(transform[:3, :3], width, height)),
        width=width,
        height=height,
        transform=transform,
        texture=reader.texture(prim),
        shaping=reader.shaping(prim),
        name=str(prim.GetPath()),
    )


def _disk(reader: LightReader, prim: Usd.Prim, transform: np.ndarray) -> scene.DiskLight:
    radius = reader.length(prim, "radius")
    return scene.DiskLight(
        radiance=reader.radiance(prim, disk_area(transform[:3, :3], radius)),
        radius=radius,
        transform=transform,
        shaping=reader.shaping(prim),
        name=str(prim.GetPath()),
    )


def _sphere(reader: LightReader, prim: Usd.Prim, transform: np.ndarray) -> scene.SphereLight:
    radius, is_point = reader.radius(prim, "treatAsPoint")
    return scene.SphereLight(
        radiance=reader.radiance(prim, sphere_area(transform[:3, :3], radius), is_point),
        radius=radius,
        transform=transform,
        shaping=reader.shaping(prim),
        name=str(prim.GetPath()),
    )


def _cylinder(reader: LightReader, prim: Usd.Prim, transform: np.ndarray) -> scene.CylinderLight:
    (radius, is_line), length = reader.radius(prim, "treatAsLine"), reader.length(prim, "length")
    return scene.CylinderLight(
        radiance=reader.radiance(prim, cylinder_area(transform[:3, :3], radius, length), is_line),
        radius=radius,
        length=length,
        transform=transform,
        shaping=reader.shaping(prim),
        name=str(prim.GetPath()),
    )


def _distant(reader: LightReader, prim: Usd.Prim, transform: np.ndarray) -> scene.DistantLight:
    angle = reader.number(prim, "angle")
    if angle < 0:
        raise Error(f"{prim.GetPath()}: angle of the light is {angle:g}; it must not be negative")
    reader.warn_of_shaping(prim)
    return scene.DistantLight(
        radiance=reader.radiance(prim, distant_size(angle)),
        angle_degrees=min(angle, 360.0),
        transform=transform,
        name=str(prim.GetPath()),
    )


# DomeLight_1 with its pole along z: latitude ±90° is ±z and longitude 0 is -y. In the frame of
# the scene description the pole is +y and longitude 0 is +z, so y → z, z → -y.
_POLE_Z = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)


def _dome(reader: LightReader, prim: Usd.Prim, transform: np.ndarray) -> scene.DomeLight:
    if singular(transform):
        raise Error(f"{prim.GetPath()}: the light's transform is singular")
    reader.warn_of_shaping(prim)
    pole = prim.GetAttribute("poleAxis").Get() if prim.GetAttribute("poleAxis") else "Y"
    if pole == "scene":
        pole = reader.up_axis
    return scene.DomeLight(
        radiance=reader.radiance(prim),
        texture=reader.dome_texture(prim),
        transform=_POLE_Z @ transform if pole == "Z" else transform,
        name=str(prim.GetPath()),
    )


READERS: dict[str, Callable[[LightReader, Usd.Prim, np.ndarray], scene.Light]] = {
    "RectLight": _rect,
    "DiskLight": _disk,
    "SphereLight": _sphere,
    "CylinderLight": _cylinder,
    "DistantLight": _distant,
    "DomeLight": _dome,
    "DomeLight_1": _dome,
}
_AT_INFINITY = {"DistantLight", "DomeLight", "DomeLight_1"}


def default_dome() -> scene.DomeLight:
    """What lights a stage that has no lights: the same radiance from everywhere."""
    return scene.DomeLight(radiance=(1.0, 1.0, 1.0), name="default light")
