"""Scenes of 24 × 16 pixels with participating media: all ways in which one is bounded, all kinds of
coefficients and phase functions, all cameras."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from support.class_scenes import GLASS
from support.scenes import GREY, WHITE, ceiling_light, picture_of, room
from support.shapes import (
    box,
    facing,
    floor,
    orthographic,
    perspective,
    quad,
    rotate,
    scale,
    sphere,
    translate,
)
from usdmlt import scene as s

CLEAR = s.Medium(name="clear")

MEDIA_SCENES: dict[str, Callable[[], s.Scene]] = {}


def scene(function: Callable[[], s.Scene]) -> Callable[[], s.Scene]:
    MEDIA_SCENES[function.__name__] = function
    return function


def volume(mesh: s.Mesh, medium: int, **others: object) -> s.Volume:
    return s.Volume(mesh.points, mesh.triangles, medium, mesh.transform, **others)


@scene
def fog_room() -> s.Scene:
    """Fog fills the world, the camera is in it."""
    return picture_of(
        perspective((0, 0, 4.2), (0, 0, 0), 36),
        meshes=[*room(), box((-0.5, -1, -0.4), (0.1, -0.2, 0.2), 1)],
        materials=[GREY, WHITE],
        lights=[ceiling_light()],
        media=[s.Medium((0.25,) * 3, (0.03,) * 3)],
        world_medium=0,
    )


@scene
def glass_ball_in_fog() -> s.Scene:
    """The caustic of a ball that no fog is in, in fog that scatters forwards."""
    return picture_of(
        perspective((0, 0.6, 4), (0, 0.1, 0), 40),
        meshes=[
            floor(0, half=3, y=-1),
            sphere(0.5, 1, transform=translate(0, 0.1, 0), medium=1),
        ],
        materials=[GREY, GLASS],
        lights=[s.SphereLight((40, 38, 30), 0.25, translate(-1.0, 1.8, 0.3))],
        media=[s.Medium((0.3, 0.3, 0.35), (0.02,) * 3, anisotropy=0.6), CLEAR],
        world_medium=0,
    )


@scene
def smoke() -> s.Scene:
    """A grid, turned and squeezed, in sunlight and skylight, seen through a thin lens."""
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, n) for n in (7, 9, 6)], indexing="ij")
    density = np.maximum(0, 1.2 - np.hypot(np.hypot(x, y), z)) * (1.2 + np.sin(5 * x + 3 * y))
    place = rotate((0, 1, 0), 30) @ rotate((1, 0, 0), 20) @ scale(1, 0.8, 1)
    corners = (-0.9, -0.8, -0.7), (0.9, 0.8, 0.7)
    bounds = box(*corners)
    camera = perspective((0, 0.5, 4), (0, 0, 0), 36)
    camera.lens_radius, camera.focus_distance = 0.08, 4.0
    return picture_of(
        camera,
        meshes=[floor(0, half=3, y=-1)],
        materials=[WHITE],
        lights=[
            s.DistantLight((60, 56, 50), 12.0, facing((0, 0, 0), (0.5, -1, -0.3))),
            s.DomeLight((0.4,) * 3),
        ],
        media=[
            s.Medium(
                (2.0,) * 3,
                (0.5,) * 3,
                anisotropy=-0.3,
                grid=s.Grid(density.astype(np.float32), *corners, place),
            )
        ],
        volumes=[s.Volume(bounds.points, bounds.triangles, 0, place)],
    )


@scene
def milk() -> s.Scene:
    """A dense liquid in a ball of glass: interfaces of both of its sides, media in each other."""
    shell, liquid = (
        s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT")),
        s.Material(s.Dielectric(1.33 / 1.5, 0.0, scatter_mode="RT")),
    )
    return picture_of(
        perspective((0, 0.6, 4), (0, 0, 0), 32),
        meshes=[
            floor(0, half=3, y=-0.9),
            sphere(0.9, 1, medium=0),
            sphere(0.75, 2, medium=1),
        ],
        materials=[GREY, shell, liquid],
        lights=[
            s.RectLight((9, 9, 9), 2, 2, facing((0.5, 2.5, 1.5), (0, 0, 0))),
            s.DomeLight((0.3,) * 3),
        ],
        media=[s.Medium(absorption=(0.3, 0.1, 0.4)), s.Medium((2.5, 2.4, 2.0), (0.01, 0.03, 0.1))],
    )


@scene
def blue_air() -> s.Scene:
    """A slab whose channels differ twentyfold, under a parallel camera and behind veils."""
    veil = s.Material(s.Diffuse((0.6, 0.6, 0.6)), opacity=0.5)
    return picture_of(
        orthographic((0, 0.8, 4), (0, 0, 0), 3.0),
        meshes=[
            floor(0, half=3, y=-1),
            quad((-1, -1, 0.4), (1.2, 0, 0), (0, 1.6, 0), 1),
            box((0.2, -1, -0.8), (0.8, 0.1, -0.3), 0),
        ],
        materials=[WHITE, veil],
        lights=[s.RectLight((9, 9, 9), 2, 2, facing((0.5, 2.4, 0.5), (0, 0, 0)))],
        media=[s.Medium((0.05, 0.3, 1.0), (0.2, 0.02, 0.0), phase="rayleigh")],
        volumes=[volume(box((-1.3, -0.9, -1.2), (1.3, 0.9, 1.1)), 0)],
    )


@scene
def overlapping() -> s.Scene:
    """Bodies in each other by size and by priority, an instance among them, one that moves."""
    ball = sphere(0.6, 1, rings=8, medium=1)
    return picture_of(
        perspective((0, 0.3, 4), (0, 0, 0), 36),
        meshes=[
            floor(0, half=3, y=-1),
            box((-1.2, -0.9, -0.6), (0.2, 0.6, 0.6), 1, medium=2, medium_priority=1),
        ],
        prototypes=[s.Prototype([ball])],
        instances=[
            s.Instances(
                0,
                np.array([translate(0.3, 0, 0)]),
                motion=np.array([[translate(0.5, 0.2, 0.1)]]),
            )
        ],
        materials=[GREY, s.Material(s.Dielectric(1.1, 0.0, scatter_mode="RT"))],
        lights=[s.RectLight((9, 9, 9), 2, 2, facing((0.5, 2.6, 1.5), (0, 0, 0)))],
        media=[
            s.Medium((0.4,) * 3),
            s.Medium((0.2, 0.6, 1.2), (0.3, 0.1, 0.0), anisotropy=0.5),
            s.Medium(absorption=(0.1, 0.6, 0.9)),
        ],
        volumes=[volume(box((-1.6, -0.95, -1.3), (1.6, 1.2, 1.3)), 0)],
    )


@scene
def thick_fog() -> s.Scene:
    """Distances, and optical depths of up to 5, that differ many times; chains through fog by a
    mirror, a glass block and a polished plate. Seen along no axis."""
    polish = s.Material(s.Conductor(roughness=0.12))
    return picture_of(
        perspective((2.6, 1.6, 2.2), (0, 0.2, 0), 50),
        meshes=[
            floor(0, half=2.5),
            quad((-1.5, 0.1, 1.2), (0, 0, -2.4), (0.3, 1.6, 0), 1),
            box((0.3, 0.2, -0.9), (1.1, 0.6, -0.2), 2, medium=1),
            quad((0.2, 0.05, 0.5), (0.9, 0, 0.3), (-0.2, 0.5, 0.5), 3),
        ],
        materials=[
            WHITE,
            s.Material(s.Conductor((0.2, 0.4, 1.4), (3.4, 2.3, 1.8), 0.0)),
            GLASS,
            polish,
        ],
        lights=[
            s.RectLight((30, 30, 25), 0.9, 0.7, facing((-0.6, 1.7, 0.2), (0, 0, 0))),
            s.SphereLight((30, 30, 30), 0.15, translate(0.9, 0.9, 0.6)),
        ],
        media=[s.Medium((1.0, 0.7, 0.4), (0.05, 0.1, 0.3), anisotropy=0.4), CLEAR],
        world_medium=0,
    )


@scene
def fire() -> s.Scene:
    """A medium glows, and lights the floor and smoke, which scatters as well; behind glass."""
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, n) for n in (6, 8, 6)], indexing="ij")
    density = np.maximum(0, 1 - np.hypot(np.hypot(x, y), z)).astype(np.float32)
    emission = density[..., None] * np.stack([2 + y, 1 + y, 0.3 + 0 * y], -1)
    corners = (-0.6, -0.8, -0.6), (0.6, 0.8, 0.6)
    return picture_of(
        perspective((0, 0.5, 4), (0, 0, 0), 36),
        meshes=[
            floor(0, half=3, y=-1),
            sphere(0.45, 1, transform=translate(0.3, -0.4, 1.1), medium=1),
        ],
        materials=[WHITE, GLASS],
        media=[
            s.Medium(
                (1.5, 1.2, 0.8),
                (0.5, 0.3, 0.3),
                emission=(0.1, 0.1, 0.4),
                grid=s.Grid(density, *corners, emission=emission.astype(np.float32)),
            ),
            s.Medium(absorption=(0.0, 0.4, 0.8), emission=(0.02, 0.0, 0.0)),
        ],
        volumes=[volume(box(*corners), 0)],
    )


# What chains are for: lights, not what glows by itself.
LIT_SCENES = {name: make for name, make in MEDIA_SCENES.items() if name != "fire"}
