"""Scenes of 24 × 16 pixels in which light takes one kind of way: most energy is in a few classes.

Among them are all cameras (perspective, thin lens, orthographic) and all kinds of light (shapes,
emissive meshes, distant lights with and without extent, domes). Lights at the end of chains of
Dirac vertices are large enough to be hit.
"""

from __future__ import annotations

from collections.abc import Callable

from support.scenes import GREEN, GREY, RED, ROOM_CAMERA, WHITE, picture_of, room, sky
from support.shapes import (
    box,
    facing,
    floor,
    orthographic,
    perspective,
    quad,
    rotate,
    sphere,
    translate,
)
from usdmlt import scene as s

GLASS = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))
WATER = s.Material(s.Dielectric(1.33, 0.0, scatter_mode="RT"))
MIRROR = s.Material(s.GeneralizedSchlick((0.9, 0.9, 0.8), roughness=0.0))
UP, DOWN = facing((0, 0, 0), (0, 1, 0), (0, 0, 1)), facing((0, 0, 0), (0, -1, 0), (0, 0, 1))

TRANSPORT_SCENES: dict[str, Callable[[], s.Scene]] = {}


def scene(function: Callable[[], s.Scene]) -> Callable[[], s.Scene]:
    TRANSPORT_SCENES[function.__name__] = function
    return function


@scene
def indirect_room() -> s.Scene:
    """LDDE, LDDDE: a lamp in a bowl that shines at the ceiling alone."""
    bowl = [
        quad((-0.5, 0.2, -0.4), (1.0, 0, 0), (0, 0, 0.8)),
        quad((-0.5, 0.2, -0.4), (1.0, 0, 0), (0, 0.25, 0)),
        quad((-0.5, 0.2, 0.4), (1.0, 0, 0), (0, 0.25, 0)),
        quad((-0.5, 0.2, -0.4), (0, 0, 0.8), (0, 0.25, 0)),
        quad((0.5, 0.2, -0.4), (0, 0, 0.8), (0, 0.25, 0)),
    ]
    return picture_of(
        ROOM_CAMERA,
        meshes=[*room((1, 2)), *bowl, box((-0.7, -1, -0.6), (-0.2, -0.3, 0))],
        materials=[WHITE, RED, GREEN],
        lights=[s.RectLight((12,) * 3, 0.8, 0.6, UP @ translate(0, 0.25, 0))],
    )


@scene
def mirror_caustic_through_a_lens() -> s.Scene:
    """LSDE, LSDDE, LSDSDE: lamps that shine at mirrors alone, out of sight; a wide lens."""
    return picture_of(
        perspective((0, 0.75, 3.8), (0, -0.1, 0), 40, lens_radius=0.2, focus_distance=3.8),
        meshes=[
            floor(0),
            quad((-3, 0, -1.6), (6, 0, 0), (0, 2.5, 0), 2),
            quad((-1.6, 1.5, -0.5), (1.2, 0.2, 0), (0, 0, 1), 1),
            quad((0.2, 1.6, -0.5), (1.2, -0.3, 0), (0, 0, 1), 1),
        ],
        materials=[WHITE, MIRROR, RED],
        lights=[
            s.DiskLight((5, 5, 5), 0.5, UP @ translate(-0.9, 0.9, 0)),
            s.DiskLight((4, 5, 6), 0.4, UP @ translate(0.8, 1.0, 0)),
        ],
    )


@scene
def pool() -> s.Scene:
    """LSDSE and what is reflected between floor and water: a lamp above flat water."""
    return picture_of(
        perspective((0, 2.6, 2.6), (0, 0, 0), 40),
        meshes=[
            floor(0, 2.5, -0.8),
            box((-2.6, -0.9, -2.6), (2.6, 0.0, 2.6), 1),
            box((-0.5, -0.8, -0.3), (0.3, -0.3, 0.4), 2),
        ],
        materials=[WHITE, WATER, RED],
        lights=[s.RectLight((6, 6, 5), 1.4, 1.4, DOWN @ translate(-0.4, 2.4, -0.8))],
    )


@scene
def seen_in_a_mirror() -> s.Scene:
    """LDSE, LSE: parallel rays that meet a tilted mirror first, and diffuse things in it."""
    return picture_of(
        orthographic((0, 1.0, 4), (0, 1.0, 0), 2.4),
        meshes=[
            quad((-2, -0.4, 0.4), (4, 0, 0), (0, 2.6, -1.6), 1),
            floor(0, 3.0, -0.4),
            box((-0.9, 2.2, 0.4), (0.0, 3.0, 1.4), 2),
            quad((-4, 5, 4), (8, 0, 0), (0, 0, -6), 0),
        ],
        materials=[WHITE, MIRROR, RED],
        lights=[
            s.SphereLight((9, 8, 7), 0.4, translate(0.9, 2.8, 1.2)),
            s.CylinderLight((3, 4, 6), 0.2, 1.5, translate(-0.5, 3.8, 2.2)),
        ],
    )


@scene
def core_in_a_glass_shell() -> s.Scene:
    """LSSDSSE: light enters two balls of glass, one in the other, and meets what is inside."""
    return picture_of(
        perspective((0, 0.6, 4), (0, 0, 0), 42),
        meshes=[
            sphere(1.3, 0, rings=12),
            sphere(0.9, 1, rings=10),
            box((-0.4, -0.4, -0.4), (0.4, 0.4, 0.4), 2, transform=rotate((1, 2, 3), 40)),
        ],
        materials=[GLASS, WATER, RED],
        textures=[s.Texture(sky())],
        lights=[s.DomeLight((0.6, 0.7, 0.9), 0, rotate((1, 0, 1), 60))],
    )


@scene
def suns_through_glass() -> s.Scene:
    """LSSDE of lights at infinity: a wide sun and one without extent, a prism, parallel rays."""
    return picture_of(
        orthographic((2, 3, 4), (0, 0.3, 0), 3.0),
        meshes=[
            floor(0, 4.0),
            box((-0.8, -0.15, -0.6), (0.5, 0.15, 0.6), 1,
                transform=rotate((1, 0, 0.5), 25) @ translate(0, 1.0, 0)),
            quad((0.9, 0.02, -0.8), (0.3, 0, 1.5), (0, 1.1, 0), 2),
        ],
        materials=[WHITE, GLASS, MIRROR],
        lights=[
            s.DistantLight((20, 16, 12), 12.0, facing((0, 0, 0), (-1, -2, -0.5))),
            s.DistantLight((0.5, 0.5, 0.7), 0.0, facing((0, 0, 0), (0.6, -1, -0.6))),
        ],
    )  # fmt: skip


@scene
def glowing_mesh_and_mirrors() -> s.Scene:
    """LSE, LDSE, LSDE, LDSDE: a mesh that glows and scatters, between mirrors, through a lens."""
    glow = s.Material(s.Add(s.Diffuse((0.5, 0.5, 0.5)), s.UniformEmission((4.0, 3.0, 2.0))))
    return picture_of(
        perspective((0, 1.2, 4.5), (0, 0.6, 0), 36, lens_radius=0.2, focus_distance=4.5),
        meshes=[
            floor(0),
            quad((-1.8, 0, 0.6), (1.0, 0, -1.4), (0, 1.6, 0), 1),
            quad((0.7, 0, -0.9), (1.0, 0, 1.4), (0, 1.6, 0), 1),
            sphere(0.35, 2, rings=5, transform=translate(0, 1.1, -0.2)),
            box((-0.4, 0, -0.3), (0.3, 0.4, 0.3), 3),
        ],
        materials=[GREY, MIRROR, glow, GREEN],
    )


@scene
def dome_and_glossy() -> s.Scene:
    """LDE, LDDE by narrow lobes: rough glass and metal under a sky, seen through a pane."""
    metal = s.Material(s.Conductor(roughness=0.12))
    frosted = s.Material(s.Dielectric(1.5, 0.15, scatter_mode="RT"))
    return picture_of(
        perspective((0, 1.5, 5), (0, 0.7, 0), 40),
        meshes=[
            floor(0, 2.5),
            sphere(0.7, 1, smooth=True, transform=translate(-0.9, 0.75, 0)),
            box((-0.5, -0.5, -0.15), (0.5, 0.5, 0.15), 2,
                transform=rotate((0, 1, 0), 30) @ translate(0.7, 0.7, 0.3)),
            box((-1.5, 0.1, 1.6), (0.2, 1.4, 1.7), 3),
        ],
        materials=[WHITE, metal, frosted, GLASS],
        textures=[s.Texture(sky())],
        lights=[s.DomeLight((0.6, 0.7, 0.9), 0, rotate((1, 0, 1), 60))],
    )  # fmt: skip


def build(name: str) -> s.Scene:
    return TRANSPORT_SCENES[name]()
