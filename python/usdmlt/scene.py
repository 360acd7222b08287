"""The scene description: plain dataclasses of NumPy arrays and floats.

It is what a USD stage is read into and what the core renders; a second way in for people without
USD. Conventions:

* Matrices are 4x4 float64 and act on **row vectors** (``p' = p @ M``), as in USD.
* Lengths are scene units. Positions may be far from the origin: the core recentres them in double
  precision.
* Colours are linear, in the rendering colour space; light colours are radiances (nit).
* Images have row 0 at the top; texture coordinate (0, 0) is the lower left corner, as in USD.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, Union

import numpy as np

from usdmlt.inputs import INPUT_NODES as INPUT_NODES
from usdmlt.inputs import Color as Color
from usdmlt.inputs import Input as Input
from usdmlt.inputs import Node as Node
from usdmlt.inputs import PrimvarInput as PrimvarInput
from usdmlt.inputs import Texture as Texture
from usdmlt.inputs import TextureInput as TextureInput

_IDENTITY = np.eye(4, dtype=np.float64)


def identity() -> np.ndarray:
    """A new 4x4 identity matrix."""
    copy: np.ndarray = _IDENTITY.copy()
    return copy


# ---------------------------------------------------------------------------------------------
# Closures. Roughness is GGX alpha (x, y), as MaterialX's closures have it; below 1e-3 it is smooth.

Roughness = Union[Input, tuple[Input, Input]]


@dataclass
class Diffuse:
    """Lambert (roughness 0) or Oren–Nayar reflection, as ``ND_oren_nayar_diffuse_bsdf``.

    With ``energy_compensation`` a white surface reflects everything at any roughness (EON).
    """

    color: Input = (0.18, 0.18, 0.18)
    weight: Input = 1.0
    roughness: Input = 0.0
    energy_compensation: bool = False


@dataclass
class Translucent:
    """Lambert transmission from one side to the other, as ``ND_translucent_bsdf``."""

    color: Input = (1.0, 1.0, 1.0)
    weight: Input = 1.0


@dataclass
class Dielectric:
    """Dielectric interface, as ``ND_dielectric_bsdf``: reflects ("R"), transmits ("T") or both.

    ``tint`` scales both, ``reflection_tint`` and ``transmission_tint`` one of them.
    """

    ior: Input = 1.5
    roughness: Roughness = 0.05
    tint: Input = (1.0, 1.0, 1.0)
    weight: Input = 1.0
    scatter_mode: Literal["R", "T", "RT"] = "R"
    reflection_tint: Input = (1.0, 1.0, 1.0)
    transmission_tint: Input = (1.0, 1.0, 1.0)


@dataclass
class Conductor:
    """Metal of complex index ``ior + i extinction``, as ``ND_conductor_bsdf``."""

    ior: Input = (0.183, 0.421, 1.373)
    extinction: Input = (3.424, 2.346, 1.770)
    roughness: Roughness = 0.05
    weight: Input = 1.0


@dataclass
class GeneralizedSchlick:
    """As ``ND_generalized_schlick_bsdf``: F = color0 + (color90 - color0)(1 - cos)^exponent.

    ``color82`` tints it at about 82 degrees, as the edges of metals are.
    """

    color0: Input = (1.0, 1.0, 1.0)
    color90: Input = (1.0, 1.0, 1.0)
    exponent: Input = 5.0
    roughness: Roughness = 0.05
    weight: Input = 1.0
    scatter_mode: Literal["R", "T", "RT"] = "R"
    color82: Input = (1.0, 1.0, 1.0)


@dataclass
class Sheen:
    """Light scattered by standing fibres, as ``ND_sheen_bsdf``."""

    color: Input = (1.0, 1.0, 1.0)
    weight: Input = 1.0
    roughness: Input = 0.3


@dataclass
class UniformEmission:
    """Radiance emitted equally in all directions from both sides, as ``ND_uniform_edf``."""

    color: Input = (1.0, 1.0, 1.0)


@dataclass
class PreviewSurface:
    """UsdPreviewSurface; inputs named as the schema's, defaults the schema's.

    ``opacity_mode`` "transparent" below opacity 1 refracts by ``ior``. A threshold, and the mode
    "presence", are cut-outs: the reader puts them in :attr:`Material.opacity` instead.
    """

    diffuseColor: Input = (0.18, 0.18, 0.18)
    emissiveColor: Input = (0.0, 0.0, 0.0)
    useSpecularWorkflow: int = 0
    specularColor: Input = (0.0, 0.0, 0.0)
    metallic: Input = 0.0
    roughness: Input = 0.5
    clearcoat: Input = 0.0
    clearcoatRoughness: Input = 0.01
    opacity: Input = 1.0
    ior: Input = 1.5


@dataclass
class Layer:
    """``top`` over ``base``: the base is scaled by what the top lets through both ways."""

    top: Closure
    base: Closure


@dataclass
class Mix:
    """``background * (1 - mix) + foreground * mix``."""

    foreground: Closure
    background: Closure
    mix: Input = 0.5


@dataclass
class Add:
    """The sum of two closures."""

    a: Closure
    b: Closure


@dataclass
class Multiply:
    """A closure scaled by a float or a colour."""

    closure: Closure
    factor: Input = 1.0


Closure = Union[
    Diffuse,
    Translucent,
    Dielectric,
    Conductor,
    GeneralizedSchlick,
    Sheen,
    UniformEmission,
    PreviewSurface,
    Layer,
    Mix,
    Add,
    Multiply,
]


@dataclass
class Material:
    """A closure, a coverage and a normal map.

    ``opacity``: the fraction of the surface that is there (1: all); what is not there lets light
    pass unchanged. With ``opacity_threshold`` > 0 it is all there where opacity >= threshold and
    not there elsewhere. ``normal``: tangent-space normal in [-1, 1] (scale and bias applied), +x
    along s of the texture it reads. ``tangent_rotation``: turns by which the direction of
    anisotropy is rotated. ``thin_walled``: the surface bounds no medium, both sides are outside.
    ``displacement``: how far points are moved along the normal, in the mesh's own units; reading a
    stage applies it. A closure of None absorbs everything.
    """

    closure: Closure | None
    opacity: Input = 1.0
    opacity_threshold: float = 0.0
    normal: TextureInput | Node | None = None
    name: str = ""
    tangent_rotation: Input = 0.0
    thin_walled: bool = False
    displacement: Input = 0.0


# ---------------------------------------------------------------------------------------------
# Media


@dataclass
class Grid:
    """Values of a box, trilinear between the centres of its cells, 0 outside.

    ``values`` (nx, ny, nz) float32 >= 0: what a medium's coefficients are multiplied by;
    ``lower`` and ``upper``: corners of the box in local space; ``transform`` local to world;
    ``emission`` (nx, ny, nz, 3) float32 >= 0: radiance per scene unit, or None.
    """

    values: np.ndarray
    lower: tuple[float, float, float] = (-0.5, -0.5, -0.5)
    upper: tuple[float, float, float] = (0.5, 0.5, 0.5)
    transform: np.ndarray = field(default_factory=identity)
    emission: np.ndarray | None = None


@dataclass
class Medium:
    """A participating medium.

    ``scattering`` and ``absorption``: coefficients per scene unit, by channel; ``emission``:
    radiance per scene unit. ``phase``: Henyey-Greenstein of mean cosine ``anisotropy`` in (-1, 1),
    0 isotropic, or "rayleigh". ``grid``: where the medium is not the same everywhere. Without any
    of them it is clear: the inside of glass in fog.
    """

    scattering: Color = (0.0, 0.0, 0.0)
    absorption: Color = (0.0, 0.0, 0.0)
    emission: Color = (0.0, 0.0, 0.0)
    phase: Literal["henyey_greenstein", "rayleigh"] = "henyey_greenstein"
    anisotropy: float = 0.0
    grid: Grid | None = None
    name: str = ""

    @classmethod
    def from_albedo(cls, albedo: Color, mean_free_path: Color, **others: Any) -> Medium:
        """From the share of scattering in what takes light out of a ray, in [0, 1], and the mean
        distance to where that happens, in scene units, > 0; ``others`` are fields."""
        extinction = [1 / length for length in mean_free_path]
        scattering = [a * sigma for a, sigma in zip(albedo, extinction, strict=True)]
        absorption = [sigma - s for sigma, s in zip(extinction, scattering, strict=True)]
        return cls(_three(scattering), _three(absorption), **others)


def _three(numbers: list[float]) -> Color:
    r, g, b = numbers
    return (r, g, b)


# ---------------------------------------------------------------------------------------------
# Geometry


@dataclass
class Primvar:
    """Values at corners: (count, width) float32, width 1 to 4.

    ``corners`` (triangles, 3) int32 indexes ``values``; None: values are per vertex. ``is_color``:
    in the rendering colour space, for layers that show it.
    """

    values: np.ndarray
    corners: np.ndarray | None = None
    is_color: bool = False


@dataclass
class MeshStep:
    """A mesh at a later time: its points, the values of its normals (None: flat), its transform."""

    points: np.ndarray
    normals: np.ndarray | None = None
    transform: np.ndarray = field(default_factory=identity)


@dataclass
class Mesh:
    """A triangle mesh, counter-clockwise seen from outside (left-handed meshes are flipped).

    The winding is that of local space; a mirroring transform does not turn the outside in.

    ``points`` (n, 3) float32 in local space; ``triangles`` (m, 3) int32; ``normals`` a
    :class:`Primvar` of width 3 in local space, None for flat shading; ``materials`` an index into
    :attr:`Scene.materials`, or (m,) int32, one per triangle; ``transform`` local to world, or to
    the prototype's space. ``motion``: while the shutter is open, at further equidistant times, the
    last when it closes; the mesh itself is as it is when the shutter opens. Points and normals
    move linearly in between. ``double_sided``: else it is there for what sees its front alone:
    looked at from behind it is not there, nor are its shadow, its reflection and its glow.
    ``collections``: names of those that it is in, for lights that are linked to one;
    ``light_link``: the one that its own emission is linked to, as of lights; ``light_group``: as
    of lights; ``is_light``: what it emits is a light's, else a material's glow.

    ``medium``: index into :attr:`Scene.media` of what it is filled with, if it is closed; None: of
    what is around it. Where filled meshes overlap the one of the highest ``medium_priority``
    counts, and among equals the smaller one.
    """

    points: np.ndarray
    triangles: np.ndarray
    normals: Primvar | None = None
    primvars: dict[str, Primvar] = field(default_factory=dict)
    materials: int | np.ndarray = 0
    transform: np.ndarray = field(default_factory=identity)
    name: str = ""
    motion: list[MeshStep] = field(default_factory=list)
    double_sided: bool = True
    collections: frozenset[str] = frozenset()
    light_link: str | None = None
    light_group: str = ""
    is_light: bool = False
    medium: int | None = None
    medium_priority: int = 0


@dataclass
class Volume:
    """A closed mesh without a surface, filled with a medium: fields as of :class:`Mesh`."""

    points: np.ndarray
    triangles: np.ndarray
    medium: int
    transform: np.ndarray = field(default_factory=identity)
    name: str = ""
    motion: list[MeshStep] = field(default_factory=list)
    medium_priority: int = 0


@dataclass
class Prototype:
    """Meshes that are placed many times."""

    meshes: list[Mesh]
    name: str = ""


@dataclass
class Instances:
    """Placements of one prototype: ``transforms`` (count, 4, 4) float64, prototype to world.

    ``motion`` (steps, count, 4, 4): at further equidistant times while the shutter is open, as of
    :class:`Mesh`; the matrices are interpolated linearly.
    """

    prototype: int
    transforms: np.ndarray
    name: str = ""
    motion: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 4, 4)))


# ---------------------------------------------------------------------------------------------
# Lights. ``radiance`` is final: intensity, exposure, colour, temperature and normalisation applied.
#
# ``light_link``: the light illuminates the meshes that have this name among their ``collections``,
# and no others; None: everything. The camera sees it all the same. What a light does not illuminate
# still casts shadows in it, and what reflects its light lights everything.
#
# ``light_group``: what layers of light paths tell the light by, beside its name.
#
# ``motion``: transforms at further equidistant times while the shutter is open, as of Camera. They
# turn and move a light, which keeps its shape.


@dataclass
class IesProfile:
    """Factors of a light's radiance by direction, bilinear between angles and 0 outside.

    ``vertical_degrees`` (n,) from the light's -z axis, ascending; ``horizontal_degrees`` (m,) about
    local +z from +x, where light comes from, from 0 to 360, or one angle for all of them;
    ``factors`` (m, n).
    """

    vertical_degrees: np.ndarray
    horizontal_degrees: np.ndarray
    factors: np.ndarray


@dataclass
class Shaping:
    """UsdLux ShapingAPI: ``focus``, ``focus_tint``, a cone of half-angle ``cone_angle_degrees``
    and an IES profile."""

    focus: float = 0.0
    focus_tint: Color = (0.0, 0.0, 0.0)
    cone_angle_degrees: float = 90.0
    cone_softness: float = 0.0
    ies: IesProfile | None = None


@dataclass
class RectLight:
    """A rectangle in the local xy plane, emitting towards -z. ``texture``: index, or None."""

    radiance: Color
    width: float = 1.0
    height: float = 1.0
    transform: np.ndarray = field(default_factory=identity)
    texture: int | None = None
    shaping: Shaping | None = None
    name: str = ""
    light_link: str | None = None
    light_group: str = ""
    motion: list[np.ndarray] = field(default_factory=list)


@dataclass
class DiskLight:
    """A disk in the local xy plane, emitting towards -z."""

    radiance: Color
    radius: float = 0.5
    transform: np.ndarray = field(default_factory=identity)
    shaping: Shaping | None = None
    name: str = ""
    light_link: str | None = None
    light_group: str = ""
    motion: list[np.ndarray] = field(default_factory=list)


@dataclass
class SphereLight:
    """A sphere (an ellipsoid under a non-uniform transform), emitting outward."""

    radiance: Color
    radius: float = 0.5
    transform: np.ndarray = field(default_factory=identity)
    shaping: Shaping | None = None
    name: str = ""
    light_link: str | None = None
    light_group: str = ""
    motion: list[np.ndarray] = field(default_factory=list)


@dataclass
class CylinderLight:
    """A cylinder along local x without caps, emitting outward."""

    radiance: Color
    radius: float = 0.5
    length: float = 1.0
    transform: np.ndarray = field(default_factory=identity)
    shaping: Shaping | None = None
    name: str = ""
    light_link: str | None = None
    light_group: str = ""
    motion: list[np.ndarray] = field(default_factory=list)


@dataclass
class DistantLight:
    """Radiance from a cone of full ``angle_degrees`` about local +z, travelling along -z.

    With an angle of 0, ``radiance`` is the irradiance on a surface that faces the light.
    """

    radiance: Color
    angle_degrees: float = 0.53
    transform: np.ndarray = field(default_factory=identity)
    name: str = ""
    light_link: str | None = None
    light_group: str = ""
    motion: list[np.ndarray] = field(default_factory=list)


@dataclass
class DomeLight:
    """An environment. ``texture`` is lat-long: row 0 is local +y, the centre column is local +z."""

    radiance: Color
    texture: int | None = None
    transform: np.ndarray = field(default_factory=identity)
    name: str = ""
    light_link: str | None = None
    light_group: str = ""
    motion: list[np.ndarray] = field(default_factory=list)


Light = Union[RectLight, DiskLight, SphereLight, CylinderLight, DistantLight, DomeLight]


# ---------------------------------------------------------------------------------------------
# Camera and scene


@dataclass
class Camera:
    """A camera that looks along local -z with +y up.

    ``window``: (left, right, bottom, top) of the image: at distance 1 for a perspective camera, in
    scene units for an orthographic one. ``lens_radius`` 0 is a pinhole. ``clipping`` (near, far)
    along the view axis. ``clipping_planes`` (n, 4): where a x + b y + c z + d < 0 in the camera's
    space for one of them, nothing is seen. ``exposure`` multiplies the image. ``motion``:
    transforms at further equidistant times while the shutter is open, as of :class:`Mesh`.
    """

    transform: np.ndarray = field(default_factory=identity)
    projection: Literal["perspective", "orthographic"] = "perspective"
    window: tuple[float, float, float, float] = (-0.5, 0.5, -0.5, 0.5)
    lens_radius: float = 0.0
    focus_distance: float = 1.0
    clipping: tuple[float, float] = (0.0, float("inf"))
    clipping_planes: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    exposure: float = 1.0
    name: str = ""
    motion: list[np.ndarray] = field(default_factory=list)


@dataclass
class Scene:
    """Everything a render needs. ``width`` and ``height`` are pixels.

    ``background``: whether the camera sees domes and distant lights directly. ``settings``: fields
    of :class:`usdmlt.Settings` that the stage asks for, unless told otherwise. ``world_medium``:
    index into ``media`` of what fills space where no mesh and no volume holds another; it is
    infinite, so that no light comes from infinity.
    """

    camera: Camera = field(default_factory=Camera)
    width: int = 256
    height: int = 256
    meshes: list[Mesh] = field(default_factory=list)
    prototypes: list[Prototype] = field(default_factory=list)
    instances: list[Instances] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    textures: list[Texture] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    media: list[Medium] = field(default_factory=list)
    volumes: list[Volume] = field(default_factory=list)
    world_medium: int | None = None
    background: bool = True
    color_space: str = "lin_rec709_scene"
    settings: dict[str, Any] = field(default_factory=dict)
    metadata: dict[str, object] = field(default_factory=dict)
