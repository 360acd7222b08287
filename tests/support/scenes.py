"""Small scenes, each with one kind of transport in it. All are 24 × 16 pixels.

Lights are large and lobes not too narrow, so that every path has a strategy that finds it well and
a few hundred samples per pixel tell two integrators apart.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from support.shapes import (
    box,
    bumpy_sheet,
    facing,
    floor,
    mesh,
    orthographic,
    perspective,
    quad,
    rotate,
    scale,
    sphere,
    translate,
)
from usdmlt import scene as s

WIDTH, HEIGHT = 24, 16

GREY = s.Material(s.Diffuse((0.5, 0.5, 0.5)))
WHITE = s.Material(s.Diffuse((0.8, 0.8, 0.8)))
RED = s.Material(s.Diffuse((0.7, 0.2, 0.1)))
GREEN = s.Material(s.Diffuse((0.15, 0.6, 0.2)))

SCENES: dict[str, Callable[[], s.Scene]] = {}


def scene(function: Callable[[], s.Scene]) -> Callable[[], s.Scene]:
    SCENES[function.__name__] = function
    return function


def picture_of(camera: s.Camera, **content: object) -> s.Scene:
    return s.Scene(camera=camera, width=WIDTH, height=HEIGHT, **content)


def room(side_materials: tuple[int, int] = (0, 0)) -> list[s.Mesh]:
    """The inside of a 2 × 2 × 2 box without the wall at +z; material 0 but for the sides."""
    left, right = side_materials
    return [
        quad((-1, -1, 1), (2, 0, 0), (0, 0, -2)),  # floor
        quad((-1, 1, -1), (2, 0, 0), (0, 0, 2)),  # ceiling
        quad((-1, -1, -1), (2, 0, 0), (0, 2, 0)),  # back
        quad((-1, -1, 1), (0, 0, -2), (0, 2, 0), left),
        quad((1, -1, -1), (0, 0, 2), (0, 2, 0), right),
    ]


def ceiling_light(radiance: float = 8.0, size: float = 0.7) -> s.RectLight:
    return s.RectLight((radiance,) * 3, size, size, rotate((1, 0, 0), -90) @ translate(0, 0.98, 0))


ROOM_CAMERA = perspective((0, 0, 4.2), (0, 0, 0), 36)


@scene
def diffuse_box() -> s.Scene:
    """A Cornell box: interreflection, colour bleeding, contact shadows."""
    turned = rotate((0, 1, 0), 25) @ translate(-0.35, -0.55, -0.3)
    return picture_of(
        ROOM_CAMERA,
        meshes=[
            *room((1, 2)),
            box((-0.3, -0.45, -0.3), (0.3, 0.45, 0.3), 0, transform=turned),
            box((0.1, -1, 0), (0.65, -0.4, 0.5)),
        ],
        materials=[WHITE, RED, GREEN],
        lights=[ceiling_light()],
    )


@scene
def glossy() -> s.Scene:
    """Rough metal, generalised Schlick and Oren–Nayar under a sphere light and a cylinder."""
    gold = s.Material(s.Conductor(roughness=(0.15, 0.4)))
    schlick = s.Material(s.GeneralizedSchlick((0.3, 0.4, 0.6), (0.9, 0.9, 0.9), roughness=0.3))
    clay = s.Material(s.Diffuse((0.6, 0.5, 0.4), roughness=0.6))
    return picture_of(
        perspective((0, 2.5, 5), (0, 0.5, 0), 38),
        meshes=[
            floor(2),
            sphere(0.8, 0, smooth=True, transform=translate(-1, 0.8, 0)),
            box((-0.6, -0.6, -0.6), (0.6, 0.6, 0.6), 1,
                transform=rotate((1, 2, 0), 40) @ translate(1.1, 0.9, 0)),
        ],
        materials=[gold, schlick, clay],
        lights=[
            s.SphereLight((9, 8, 7), 0.6, translate(1.5, 3, 2)),
            s.CylinderLight((3, 4, 6), 0.25, 2.5, rotate((0, 1, 0), 70) @ translate(-2, 2.2, 1)),
        ],
    )  # fmt: skip


@scene
def rough_glass() -> s.Scene:
    """A rough glass ball and a rough slab: refraction that light and camera subpaths both make."""
    glass = s.Material(s.Dielectric(1.5, 0.35, scatter_mode="RT"))
    return picture_of(
        perspective((0, 2, 5), (0, 0.6, 0), 36),
        meshes=[
            floor(0),
            sphere(0.8, 1, smooth=True, transform=translate(-0.8, 0.9, 0)),
            box((-0.5, -0.5, -0.2), (0.5, 0.5, 0.2), 1,
                transform=rotate((0, 1, 0), 30) @ translate(1.1, 0.8, 0.2)),
        ],
        materials=[WHITE, glass],
        lights=[s.DiskLight((10, 10, 9), 0.9, facing((1, 3.5, -1), (0, 0.5, 0)))],
    )  # fmt: skip


@scene
def smooth_glass() -> s.Scene:
    """Dirac reflection and refraction: caustics on the floor, of a light large enough to be hit."""
    glass = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))
    mirror = s.Material(s.Conductor(roughness=0.0))
    return picture_of(
        perspective((0, 2, 5), (0, 0.6, 0), 36),
        meshes=[
            floor(0),
            sphere(0.8, 1, smooth=True, transform=translate(-0.8, 0.9, 0)),
            quad((0.5, 0.05, 0.6), (1.2, 0, -0.9), (0, 1.3, 0), 2),
        ],
        materials=[WHITE, glass, mirror],
        lights=[s.RectLight((3, 3, 3), 3.0, 3.0, facing((0.5, 3.2, 0), (0.4, 0, 0), (0, 0, 1)))],
    )


@scene
def caustics() -> s.Scene:
    """A lamp that shines at a mirror and through a glass block, and at nothing else.

    What is seen on the floor comes from light subpaths by Dirac vertices.
    """
    glass = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))
    mirror = s.Material(s.Conductor((0.2, 0.4, 1.4), (3.4, 2.3, 1.8), 0.0))
    up, down = facing((0, 0, 0), (0, 1, 0), (0, 0, 1)), facing((0, 0, 0), (0, -1, 0), (0, 0, 1))
    return picture_of(
        perspective((0, 3, 3.5), (0, 0, 0.6), 30),
        meshes=[
            floor(0),
            quad((-1.6, 1.5, -0.5), (1.2, 0.2, 0), (0, 0, 1), 1),
            box((0.2, 0.35, -0.5), (1.2, 0.65, 0.5), 2),
        ],
        materials=[WHITE, mirror, glass],
        lights=[
            s.DiskLight((5, 5, 5), 0.6, up @ translate(-0.9, 0.9, 0)),
            s.DiskLight((5, 5, 5), 0.6, down @ translate(0.7, 1.0, 0)),
        ],
    )


@scene
def thin_lens() -> s.Scene:
    """A wide lens focused on the middle of three boxes, one of them glowing."""
    glow = s.Material(s.Add(s.Diffuse((0.5, 0.5, 0.5)), s.UniformEmission((1.0, 0.7, 0.4))))
    return picture_of(
        perspective((0, 1.2, 5), (0, 0.5, 0), 36, lens_radius=0.35, focus_distance=5.0),
        meshes=[
            floor(0),
            box((-1.6, 0, -2.5), (-0.8, 1.0, -1.7), 1),
            box((-0.3, 0, -0.3), (0.4, 0.9, 0.3), 2),
            box((0.7, 0, 1.2), (1.1, 0.8, 1.6), 3),
        ],
        materials=[WHITE, RED, GREEN, glow],
        lights=[s.RectLight((6, 6, 6), 2, 2, facing((2, 4, 2), (0, 0, 0)))],
    )


def sky(width: int = 16, height: int = 8) -> np.ndarray:
    """A gradient with one brighter patch."""
    rng = np.random.default_rng(5)
    pixels = rng.uniform(0.2, 1.0, (height, width, 3))
    pixels[1:3, 3:5] += 6.0
    return pixels.astype(np.float32)


@scene
def dome_and_distant() -> s.Scene:
    """A textured dome, turned and seen directly, a wide sun and a sun without extent."""
    return picture_of(
        perspective((0, 1.5, 5), (0, 0.8, 0), 42),
        meshes=[
            floor(0, 2.0),
            box((-1.2, 0, -0.6), (-0.2, 1.1, 0.4), 1),
            sphere(0.7, 2, smooth=True, transform=translate(0.9, 0.8, 0.2)),
        ],
        materials=[WHITE, RED, s.Material(s.Conductor(roughness=0.4))],
        textures=[s.Texture(sky())],
        lights=[
            s.DomeLight((0.6, 0.7, 0.9), 0, rotate((1, 0, 1), 60)),
            s.DistantLight((20, 16, 12), 12.0, facing((0, 0, 0), (-1, -2, -0.5))),
            s.DistantLight((0.5, 0.5, 0.7), 0.0, facing((0, 0, 0), (1, -1, -1))),
        ],
    )


@scene
def instances() -> s.Scene:
    """Instances under rotations, non-uniform and negative scales; some of them emit."""
    rng = np.random.default_rng(3)
    lamp = s.Material(s.UniformEmission((4, 3.5, 3)))
    squashed = scale(0.7, 1.2, 0.5) @ translate(0.4, 0, 0)
    pair = s.Prototype([
        box((-0.4, -0.4, -0.4), (0.1, 0.4, 0.4), 1),
        sphere(0.5, 0, rings=8, smooth=True, transform=squashed),
    ])  # fmt: skip
    glowing = s.Prototype([
        box((-0.2, 0.1, -0.2), (0.2, 0.2, 0.2), 0),
        quad((-0.3, 0, -0.3), (0.6, 0, 0), (0, 0, 0.6), 2),
        mesh([(-0.3, 0.3, 0), (0.3, 0.3, 0), (0, 0.7, 0)], [(0, 1, 2)], 2),
    ])  # fmt: skip
    placed = []
    for i in range(30):
        size = rng.uniform(0.3, 0.7, 3) * rng.choice([-1, 1], 3)
        where = (-2 + 0.8 * (i % 6), 0.4 + 0.2 * rng.random(), -1.6 + 0.8 * (i // 6))
        placed.append(scale(*size) @ rotate(rng.normal(size=3), 360 * rng.random())
                      @ translate(*where))  # fmt: skip
    lamps = [
        scale(1.5, 1, -0.8) @ rotate((1, 0.3, 0), 160) @ translate(-1, 2.2, 0.5),
        scale(-1, 1.4, 1.2) @ rotate((0, 1, 1), 50) @ translate(1.4, 2.0, 0.8),
        rotate((1, 0, 0), 200) @ scale(1, 1, 2) @ translate(0.2, 2.4, -1.2),
    ]
    return picture_of(
        perspective((0, 3, 5), (0, 0.4, 0), 40),
        meshes=[floor(0)],
        prototypes=[pair, glowing],
        instances=[s.Instances(0, np.array(placed)), s.Instances(1, np.array(lamps))],
        materials=[WHITE, RED, lamp],
    )


@scene
def shading_normals() -> s.Scene:
    """Interpolated normals far from the geometric ones: a coarse ball and a bumpy sheet."""
    return picture_of(
        perspective((0, 3, 4.5), (0, 0.3, 0), 40),
        meshes=[
            bumpy_sheet(0),
            sphere(0.8, 1, rings=5, smooth=True, transform=translate(0.2, 1.0, 0)),
        ],
        materials=[WHITE, s.Material(s.GeneralizedSchlick((0.6, 0.6, 0.6), roughness=0.35))],
        lights=[
            s.SphereLight((12, 12, 12), 0.6, translate(-2, 3, 1)),
            s.RectLight((5, 4, 3), 1.5, 1.5, facing((2.5, 2.5, 0.5), (0, 0.5, 0))),
        ],
    )


@scene
def tilted_normals() -> s.Scene:
    """A floor that is lit by what two panels reflect, whose normals are turned by 40 degrees: light
    subpaths do the work, and cosines to the two normals differ all in the same sense."""

    def panel(x: float, turn: float, material: int) -> s.Mesh:
        normal = rotate((0, 0, 1), turn)[:3, :3].T @ (0, -1, 0)
        normals = s.Primvar(np.tile(normal, (4, 1)).astype(np.float32))
        return quad((x, 1.6, -0.6), (1.2, 0, 0), (0, 0, 1.2), material, normals=normals)

    up = facing((0, 0, 0), (0, 1, 0), (0, 0, 1))
    return picture_of(
        perspective((0, 0.9, 4), (0, 0.5, 0), 42),
        meshes=[floor(0, 2.5), panel(-1.4, 40, 1), panel(0.2, -40, 2)],
        materials=[
            WHITE,
            s.Material(s.Diffuse((0.9, 0.8, 0.7))),
            s.Material(s.GeneralizedSchlick((0.8, 0.8, 0.8), roughness=0.4)),
        ],
        lights=[
            s.DiskLight((12, 12, 12), 0.3, up @ translate(-0.9, 1.2, 0)),
            s.DiskLight((12, 12, 12), 0.3, up @ translate(0.7, 1.2, 0)),
        ],
    )


@scene
def opacity() -> s.Scene:
    """Fractional coverage, of lamps too, and cut-outs by a texture's alpha."""
    rng = np.random.default_rng(8)
    veil = s.Material(s.Diffuse((0.6, 0.3, 0.3)), opacity=0.4)
    holes = s.Material(
        s.Diffuse((0.3, 0.5, 0.7)), opacity=s.TextureInput(0, channel="a"), opacity_threshold=0.5
    )
    fade = s.Material(s.Diffuse((0.6, 0.6, 0.2)), opacity=s.TextureInput(0, channel="a"))
    lamp = s.Material(s.UniformEmission((6, 6, 6)), opacity=0.6)
    return picture_of(
        perspective((0, 1.5, 5), (0, 0.8, 0), 40),
        meshes=[
            floor(0),
            box((-1.4, 0, -0.8), (-0.4, 1.0, 0.2), 1),
            quad((0, 0.1, 1), (1.5, 0, -0.5), (0, 1.4, 0.2), 2),
            quad((-1.5, 0.2, 1.4), (1.2, 0, 0), (0, 0.8, 0), 3),
            quad((-1, 2.6, -1), (1.6, 0, 0), (0, 0, 1.6), 4),
            quad((-1.2, 2.0, -1.2), (1.2, 0, 0), (0, 0.2, 2), 1),
        ],
        materials=[WHITE, veil, holes, fade, lamp],
        textures=[s.Texture(rng.uniform(0, 1, (6, 6, 4)).astype(np.float32), "clamp", "clamp")],
        lights=[s.RectLight((3, 3, 3), 1, 1, facing((2.5, 2.5, 2), (0, 0.5, 0)))],
    )


@scene
def orthographic_camera() -> s.Scene:
    """Parallel rays: the lens is at infinity, as a distant light is."""
    return picture_of(
        orthographic((2, 3, 4), (0, 0.5, 0), 3.2),
        meshes=[floor(0, 4.0), box((-0.8, 0, -0.5), (0.2, 1.0, 0.5), 1), sphere(
            0.5, 2, smooth=True, transform=translate(0.8, 0.6, 0.3))],
        materials=[WHITE, RED, s.Material(s.Conductor(roughness=0.3))],
        lights=[
            s.RectLight((6, 6, 6), 1.5, 1.5, facing((1, 3, -1), (0, 0.5, 0))),
            s.DistantLight((2, 2, 3), 0.0, facing((0, 0, 0), (-1, -1.5, 0.4))),
        ],
    )  # fmt: skip


@scene
def emission() -> s.Scene:
    """Meshes that emit from both sides, scatter as well, and glow by texture."""
    rng = np.random.default_rng(4)
    lamp = s.Material(s.Add(s.Diffuse((0.7, 0.7, 0.7)), s.UniformEmission((1.5, 1.2, 0.9))))
    screen = s.Material(s.Add(
        s.Conductor(roughness=0.3), s.UniformEmission(s.TextureInput(0, channel="rgb"))
    ))  # fmt: skip
    return picture_of(
        ROOM_CAMERA,
        meshes=[
            *room((1, 2)),
            quad((-0.5, 0.1, -0.4), (1.0, 0.2, 0), (0, 0, 0.9), 3),
            quad((-0.6, -0.9, -0.5), (0.7, 0, -0.3), (0, 0.7, 0.2), 4),
            sphere(0.25, 3, rings=6, smooth=True, transform=translate(0.5, -0.6, 0.3)),
        ],
        materials=[WHITE, RED, GREEN, lamp, screen],
        textures=[s.Texture(rng.uniform(0, 3, (4, 4, 3)).astype(np.float32), "clamp", "clamp")],
    )


@scene
def layers() -> s.Scene:
    """Coats over diffuse and metal, mixtures, thin and solid preview surfaces, a normal map."""
    rng = np.random.default_rng(6)
    normals = rng.normal(size=(8, 8, 3)) * (0.25, 0.25, 0) + (0, 0, 1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    coat = s.Dielectric(1.5, 0.25)
    materials = [
        s.Material(s.Layer(coat, s.Diffuse((0.7, 0.5, 0.2)))),
        s.Material(s.Layer(s.Dielectric(1.6, 0.0), s.Conductor(roughness=0.4))),
        s.Material(s.Mix(s.Diffuse((0.2, 0.5, 0.8)), s.GeneralizedSchlick(roughness=0.3), 0.6)),
        s.Material(s.PreviewSurface((0.6, 0.2, 0.2), clearcoat=1.0, clearcoatRoughness=0.5)),
        s.Material(s.PreviewSurface((0.2, 0.6, 0.3), opacity=0.5, roughness=0.6)),
        s.Material(s.PreviewSurface((0.8, 0.7, 0.4), metallic=0.7),
                   normal=s.TextureInput(0)),
    ]  # fmt: skip
    meshes = [floor(0)]
    for i in range(5):
        at = translate(-1.6 + 0.8 * i, 0.5, 0.6 * (i % 2))
        shape = sphere(0.42, 1 + i, smooth=True) if i % 2 else box((-0.35,) * 3, (0.35,) * 3, 1 + i)
        shape.transform = rotate((0, 1, 0), 30) @ at
        meshes.append(shape)
    meshes.append(quad((-1.8, 0.1, -1.2), (3.6, 0, 0), (0, 1.6, -0.3), 5))
    return picture_of(
        perspective((0, 1.8, 5), (0, 0.6, 0), 36),
        meshes=meshes,
        materials=materials,
        textures=[s.Texture(normals.astype(np.float32))],
        lights=[
            s.RectLight((7, 7, 7), 1.6, 1.6, facing((1, 3.4, 1), (0, 0.3, 0))),
            s.SphereLight((6, 7, 9), 0.4, translate(-2, 2, 1.5)),
        ],
    )


@scene
def shaped_lights() -> s.Scene:
    """All families of lights with a cone or a focus; an ellipsoid and a textured rect, too."""
    rng = np.random.default_rng(7)
    down = (0, 0, 0)
    spot = s.Shaping(cone_angle_degrees=35, cone_softness=0.3)
    focus = s.Shaping(focus=3.0, focus_tint=(0.2, 0.1, 0.0))
    return picture_of(
        perspective((0, 3, 5), (0, 0.3, 0), 40),
        meshes=[floor(0), box((-0.4, 0, -0.4), (0.4, 0.8, 0.4), 1)],
        materials=[WHITE, RED],
        textures=[s.Texture(rng.uniform(0, 2, (3, 5, 3)).astype(np.float32))],
        lights=[
            s.RectLight((9, 9, 9), 0.8, 0.5, facing((-2, 2.2, 0), down), 0, spot),
            s.DiskLight((9, 6, 6), 0.4, scale(1.5, 0.7, 1) @ facing((2, 2, 0.5), down), focus),
            s.SphereLight((8, 8, 12), 0.3, scale(1, 2, 0.6) @ facing((0.5, 2.5, -2), down), spot),
            s.CylinderLight((5, 8, 5), 0.15, 1.0, facing((0.2, 2.2, 1.8), down), focus),
        ],
    )


@scene
def clipped_and_mirrored_camera() -> s.Scene:
    """A left-handed camera off its axis whose near plane cuts a wall away, with exposure."""
    camera = s.Camera(
        scale(-1, 1, 1) @ facing((0.3, 0.2, 4.2), (0.1, 0, 0)),
        window=(-0.6, 0.4, -0.25, 0.4167),
        clipping=(2.6, 5.0),
        exposure=1.7,
    )
    return picture_of(
        camera,
        meshes=[*room((1, 2)), quad((-3, -3, 2), (6, 0, 0), (0, 6, 0)), box(
            (-0.3, -1, -0.3), (0.4, -0.2, 0.4))],
        materials=[WHITE, RED, GREEN],
        lights=[ceiling_light()],
    )  # fmt: skip


@scene
def motion() -> s.Scene:
    """While the shutter is open: a lens, boxes, a ball that grows, instances and lamps move."""

    def path(mesh: s.Mesh, *later: np.ndarray) -> s.Mesh:
        values = mesh.normals and mesh.normals.values
        mesh.motion = [s.MeshStep(mesh.points, values, transform) for transform in later]
        return mesh

    lamp = s.Material(s.Add(s.Diffuse((0.5, 0.5, 0.5)), s.UniformEmission((3.0, 2.6, 2.0))))
    turns = [rotate((0, 1, 0), 20.0 * i) @ translate(-1.2, 0.6, 0.1 * i) for i in range(5)]
    ball = sphere(0.4, 2, rings=8, smooth=True, transform=translate(0.2, 0.5, 0.6))
    ball.motion = [s.MeshStep(1.6 * ball.points, ball.normals.values, translate(0.9, 0.8, 0.6))]
    glowing = s.Prototype([quad((-0.4, 0, -0.4), (0.8, 0, 0), (0, 0, 0.8), 3)])
    above = rotate((1, 0, 0), 180)
    first = [above @ translate(x, 2.2, -0.6) for x in (-1.5, 1.5)]
    last = [scale(1.5, 1, 0.6) @ m @ rotate((0, 1, 0), 30) for m in first]
    camera = perspective((0, 1.6, 5), (0, 0.5, 0), 38, lens_radius=0.2, focus_distance=5.0)
    camera.motion = [facing((0.3, 1.7, 4.9), (0.2, 0.5, 0)), facing((0.5, 1.6, 4.8), (0.1, 0.6, 0))]
    return picture_of(
        camera,
        meshes=[
            floor(0),
            path(box((-0.4, -0.5, -0.3), (0.4, 0.5, 0.3), 1, transform=turns[0]), *turns[1:]),
            ball,
            path(
                quad((-0.6, 0, -0.6), (0, 0, 1.2), (1.2, 0, 0), 3, transform=translate(0, 2.6, 1)),
                scale(0.4, 1, 1.3) @ translate(0.8, 2.2, 1),
            ),
        ],
        prototypes=[glowing],
        instances=[s.Instances(0, np.array(first), motion=np.array([last]))],
        materials=[WHITE, RED, s.Material(s.Conductor(roughness=0.4)), lamp],
    )


@scene
def moving_lights() -> s.Scene:
    """Lights of all kinds turn and pass while the shutter is open: shapes, one of them shaped, an
    environment of a dome and a distant light, a sun without extent; onto glass and rough metal."""
    sky = np.zeros((16, 32, 3), np.float32)
    sky[:8, :16] = 0.6
    sky[3, 20:22] = 12.0

    def turning(light: s.Light, axis: tuple, degrees: float, move: tuple = (0, 0, 0)) -> s.Light:
        start = light.transform
        light.motion = []
        for i in range(1, 5):
            turned = rotate(axis, degrees * i / 4)
            turned[:3, :3] = start[:3, :3] @ turned[:3, :3]
            turned[3, :3] = start[3, :3] + np.array(move) * (i / 4)
            light.motion.append(turned)
        return light

    down = rotate((1, 0, 0), -90)
    spot = s.Shaping(cone_angle_degrees=40.0, cone_softness=0.5)
    lights = [
        turning(s.RectLight((4, 3, 2), 0.8, 0.5, down @ translate(-1, 2, 0)), (0, 0, 1), 60),
        turning(s.DiskLight((9, 9, 9), 0.3, down @ translate(1, 2, 1), spot), (1, 0, 0.3), 70),
        turning(s.SphereLight((3, 4, 6), 0.15, translate(-1.5, 0.6, 1)), (0, 1, 0), 0, (1.2, 1, 0)),
        turning(s.CylinderLight((6, 2, 2), 0.08, 1.2, translate(0.6, 1.5, -1)), (0, 1, 0), 90),
        turning(s.DomeLight((1, 1, 1), texture=0), (0.2, 1, 0), 120),
        turning(s.DistantLight((20, 18, 15), 8.0, down), (1, 0, 0), 60),
        turning(s.DistantLight((0.5, 0.4, 0.9), 0.0, down @ rotate((0, 0, 1), 30)), (0, 1, 0), 90),
    ]
    ball = sphere(0.5, 2, rings=8, smooth=True, transform=translate(-0.2, 0.6, 0.5))
    return picture_of(
        perspective((0, 2.0, 5), (0, 0.5, 0), 38),
        meshes=[floor(0), ball, box((0.5, 0, -0.4), (1.1, 0.7, 0.3), 1)],
        materials=[
            WHITE,
            s.Material(s.Conductor(roughness=0.3)),
            s.Material(s.Dielectric(1.5, 0.25, scatter_mode="RT")),
        ],
        textures=[s.Texture(sky)],
        lights=lights,
    )


@scene
def linked_lights() -> s.Scene:
    """Lights of all kinds that illuminate some things only: shapes, a mesh, an environment of
    three lights, a sun without extent; through glass, and instances."""
    ground, props, glass = map(frozenset, (["ground"], ["props"], ["props", "glass"]))
    ball = sphere(0.6, 2, rings=8, smooth=True, transform=translate(-0.9, 0.7, 0.3))
    lamp = quad((0.9, 1.6, -1.0), (0, 0, 0.9), (0.9, 0.4, 0), 3)
    post = box((-0.15, 0, -0.15), (0.15, 0.8, 0.15), 1)
    ball.collections, lamp.light_link, post.collections = glass, "ground", props
    return picture_of(
        perspective((0, 2.2, 5), (0, 0.5, 0), 38),
        meshes=[
            floor(0, collections=ground),
            box((0.2, 0, 0), (0.9, 0.8, 0.7), 1, collections=props),
            ball,
            lamp,
        ],
        prototypes=[s.Prototype([post])],
        instances=[s.Instances(0, np.array([translate(x, 0, -0.8) for x in (-1.5, -0.2)]))],
        materials=[
            WHITE,
            RED,
            s.Material(s.Dielectric(1.5, 0.25, scatter_mode="RT")),
            s.Material(s.Add(s.Diffuse((0.5, 0.5, 0.5)), s.UniformEmission((3, 2.5, 2)))),
        ],
        textures=[s.Texture(sky())],
        lights=[
            s.RectLight((9, 8, 6), 1.2, 1.2, facing((-1.5, 3, 1), (-1, 0, 0)), light_link="glass"),
            s.SphereLight((4, 7, 4), 0.3, translate(0.1, 1.9, 0.6), light_link="props"),
            s.DiskLight((3, 3, 3), 0.4, facing((1.6, 2.6, 2), (0.4, 0, 0))),
            s.DomeLight((0.4, 0.5, 0.8), 0, light_link="props"),
            s.DomeLight((0.1, 0.1, 0.1)),
            s.DistantLight((30, 25, 20), 14.0, facing((0, 0, 0), (1, -2, 0)), light_link="ground"),
            s.DistantLight((0.3, 0.6, 0.9), 0.0, facing((0, 0, 0), (-1, -2, -1)),
                           light_link="props"),
        ],
    )  # fmt: skip


@scene
def one_sided() -> s.Scene:
    """Surfaces that are there for what sees their front: a room with all its walls, looked into
    from outside; open boxes, a lamp, a leaf and a veil that are turned either way, and mirrored."""
    back = quad((1, -1, 1), (-2, 0, 0), (0, 2, 0))  # the wall at +z, which faces inwards
    cup = box((-0.25, -1, -0.25), (0.25, -0.4, 0.25), 1, transform=translate(-0.45, 0, 0.2))
    cup.triangles = cup.triangles[:, ::-1]
    leaf = quad((0.2, -0.6, 0.1), (0.5, 0, 0.2), (0, 0.7, 0.1), 3)
    mirrored = quad((0.2, -0.2, -0.3), (0.6, 0, 0.2), (0, 0.6, 0), 1, transform=scale(-1, 1, 1))
    lamp = quad((-0.9, 0.3, -0.5), (0.5, 0, 0), (0, 0.2, 0.6), 4)
    veil = quad((0.1, -0.4, 0.6), (0.7, 0, 0), (0, 0.8, 0.1), 5)
    meshes = [*room((1, 2)), back, cup, leaf, mirrored, lamp, veil]
    tile = s.Prototype([quad((-0.2, 0, -0.2), (0.4, 0, 0), (0, 0, 0.4), 2)])
    placements = [scale(-1, 1, 1) @ translate(0.6, 0.5, -0.2), translate(0.1, 0.6, 0.3)]
    for shape in (*meshes, *tile.meshes):
        shape.double_sided = False
    return picture_of(
        ROOM_CAMERA,
        meshes=meshes,
        prototypes=[tile],
        instances=[s.Instances(0, np.array(placements))],
        materials=[
            WHITE,
            RED,
            GREEN,
            s.Material(s.Add(s.Diffuse((0.1, 0.4, 0.1)), s.Translucent((0.2, 0.5, 0.1)))),
            s.Material(s.Add(s.Diffuse((0.5, 0.5, 0.5)), s.UniformEmission((4, 3, 2)))),
            s.Material(s.Diffuse((0.6, 0.6, 0.6)), opacity=0.5),
        ],
        lights=[ceiling_light(), s.SphereLight((9, 9, 12), 0.5, translate(0.5, -0.3, 2.6))],
    )


def build(name: str) -> s.Scene:
    return SCENES[name]()
