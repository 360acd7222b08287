"""UsdLux lights: size, shaping and the radiance that follows from all of a light's inputs.

L = intensity · 2^exposure · color · blackbody(colorTemperature) / (normalize ? size : 1)
(UsdLux overview; with one unit of intensity meaning one nit). Sizes are in world space, scale
included, as hdEmbree takes them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from pxr import Usd, UsdLux

from usdmlt import scene
from usdmlt.errors import Error, Report
from usdmlt.stage.color import DEFAULT, ColorSpaces
from usdmlt.stage.numbers import finite_number
from usdmlt.stage.textures import Textures

# ---------------------------------------------------------------------------------------------
# World-space sizes that `normalize` divides by. `linear` (3, 3): rows are where x, y, z go.


def rect_area(linear: np.ndarray, width: float, height: float) -> float:
    """The area of the parallelogram that a rectangle becomes."""
    return float(np.linalg.norm(np.cross(linear[0] * width, linear[1] * height)))


def disk_area(linear: np.ndarray, radius: float) -> float:
    """The area of the ellipse that a disk becomes."""
    return math.pi * radius**2 * float(np.linalg.norm(np.cross(linear[0], linear[1])))


def sphere_area(linear: np.ndarray, radius: float) -> float:
    """The area of an ellipsoid by Thomsen's formula, p = 1.6075 (within 1.1 %; exact for spheres).

    The semi-axes are the singular values of the transform.
    """
    a, b, c = radius * np.linalg.svd(linear, compute_uv=False)
    p = 1.6075
    mean = ((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3
    return float(4 * math.pi * mean ** (1 / p))


def cylinder_area(linear: np.ndarray, radius: float, length: float) -> float:
    """The lateral area: the ellipse's perimeter (Ramanujan 1914) times the length, no caps."""
    a, b = radius * np.linalg.norm(linear[1]), radius * np.linalg.norm(linear[2])
    h = ((a - b) / (a + b)) ** 2
    perimeter = math.pi * (a + b) * (1 + 3 * h / (10 + math.sqrt(4 - 3 * h)))
    return float(perimeter * length * np.linalg.norm(linear[0]))


def distant_size(angle_degrees: float) -> float:
    """The solid angle, weighted by the cosine, of a distant light: radiance 1 gives this many lux.

    θ = angle / 2: π sin²θ up to a hemisphere, π (2 - sin²θ) beyond; 1 for a Dirac light.
    """
    theta = min(max(math.radians(angle_degrees) / 2, 0.0), math.pi)
    if theta == 0:
        return 1.0
    sine2 = math.sin(theta) ** 2
    return math.pi * sine2 if theta <= math.pi / 2 else math.pi * (2 - sine2)


# ---------------------------------------------------------------------------------------------
# Reading


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

    def read(self, prim: Usd.Prim, kind: str, transform: np.ndarray) -> scene.Light:
        """One light of a type in :data:`READERS`. ``transform`` (4, 4): light to world.

        Raises :class:`Error` with the prim path for sizes and transforms that emit nothing.
        """
        self._warn_of_unsupported(prim, kind)
        linear = transform[:3, :3]
        if kind not in _AT_INFINITY and not abs(np.linalg.det(linear)) > 0:
            raise Error(f"{prim.GetPath()}: the light's transform is singular")
        return READERS[kind](self, prim, transform)

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

    def radiance(self, prim: Usd.Prim, size: float = 1.0) -> scene.Color:
        """The light's radiance in the rendering colour space; ``size``: its normalization."""
        strength = self.number(prim, "intensity") * 2.0 ** self.number(prim, "exposure")
        if strength < 0:
            self.report.warn("lights of negative intensity are dark", prim.GetPath())
            strength = 0.0
        if self.value(prim, "normalize"):
            strength /= size
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
        return (float(rgb[0]), float(rgb[1]), float(rgb[2]))

    def shaping(self, prim: Usd.Prim) -> scene.Shaping | None:
        """Cone and focus, where ShapingAPI is applied or authored."""
        names = ("focus", "focusTint", "cone:angle", "cone:softness")
        applied = prim.HasAPI(UsdLux.ShapingAPI)
        if not applied and not any(self._authored(prim, f"shaping:{name}") for name in names):
            return None
        profile = self.value(prim, "shaping:ies:file")
        if profile is not None and profile.path:
            self.report.warn("IES profiles are not rendered", prim.GetPath())
        values = [self.value(prim, f"shaping:{name}") for name in names]
        default = scene.Shaping()
        tint = self.attribute(prim, "shaping:focusTint")
        return scene.Shaping(
            focus=default.focus if values[0] is None else float(values[0]),
            focus_tint=default.focus_tint
            if values[1] is None
            else self.colors.color(values[1], tint),
            cone_angle_degrees=default.cone_angle_degrees
            if values[2] is None
            else float(values[2]),
            cone_softness=default.cone_softness if values[3] is None else float(values[3]),
        )

    def warn_of_shaping(self, prim: Usd.Prim) -> None:
        """Lights at infinity are not shaped; say so where one was meant to be."""
        shaping = self.shaping(prim)
        names = ("shaping:focus", "shaping:cone:angle")
        authored = any(self._authored(prim, name) for name in names)
        if shaping and authored and (shaping.focus > 0 or shaping.cone_angle_degrees < 90):
            self.report.warn("shaping of lights at infinity is ignored", prim.GetPath())

    def texture(self, prim: Usd.Prim) -> int | None:
        """The index of the light's texture; None if it has none or it cannot be read."""
        attribute = self.attribute(prim, "texture:file")
        value = attribute.Get(self.time) if attribute else None
        if value is None or not value.path:
            return None
        return self.textures.add_light_texture(attribute, value)

    def _authored(self, prim: Usd.Prim, name: str) -> bool:
        attribute = self.attribute(prim, name)
        return bool(attribute) and attribute.HasAuthoredValue()

    def _warn_of_unsupported(self, prim: Usd.Prim, kind: str) -> None:
        path, report = prim.GetPath(), self.report
        for name in ("diffuse", "specular"):
            value = self.value(prim, name)
            if value is not None and value != 1:
                report.warn("diffuse and specular multipliers of lights are ignored", path)
        if prim.GetRelationship("light:filters").GetTargets():
            report.warn("light filters are not rendered", path)
        for collection in ("lightLink", "shadowLink"):
            rule = prim.GetAttribute(f"collection:{collection}:includeRoot")
            linked = rule and rule.Get(self.time) is False
            for part in ("includes", "excludes"):
                targets = prim.GetRelationship(f"collection:{collection}:{part}")
                linked = linked or (targets and targets.GetTargets())
            if linked:
                report.warn("light and shadow linking are ignored", path)
        if prim.HasAPI(UsdLux.ShadowAPI) and self.value(prim, "shadow:enable") is False:
            report.warn("lights always cast shadows", path)


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
    radius = reader.length(prim, "radius")
    return scene.SphereLight(
        radiance=reader.radiance(prim, sphere_area(transform[:3, :3], radius)),
        radius=radius,
        transform=transform,
        shaping=reader.shaping(prim),
        name=str(prim.GetPath()),
    )


def _cylinder(reader: LightReader, prim: Usd.Prim, transform: np.ndarray) -> scene.CylinderLight:
    radius, length = reader.length(prim, "radius"), reader.length(prim, "length")
    return scene.CylinderLight(
        radiance=reader.radiance(prim, cylinder_area(transform[:3, :3], radius, length)),
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
    if not abs(np.linalg.det(transform[:3, :3])) > 0:
        raise Error(f"{prim.GetPath()}: the light's transform is singular")
    layout = reader.value(prim, "texture:format")
    if layout not in (None, UsdLux.Tokens.automatic, UsdLux.Tokens.latlong):
        reader.report.warn("dome textures are read as latlong", f"{prim.GetPath()} ({layout})")
    reader.warn_of_shaping(prim)
    pole = prim.GetAttribute("poleAxis").Get() if prim.GetAttribute("poleAxis") else "Y"
    if pole == "scene":
        pole = reader.up_axis
    return scene.DomeLight(
        radiance=reader.radiance(prim),
        texture=reader.texture(prim),
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


def moved(light: scene.Light, transform: np.ndarray) -> scene.Light:
    """The light of a prototype where an instance has it."""
    return replace(light, transform=light.transform @ transform)


def default_dome() -> scene.DomeLight:
    """What lights a stage that has no lights: the same radiance from everywhere."""
    return scene.DomeLight(radiance=(1.0, 1.0, 1.0), name="default light")
