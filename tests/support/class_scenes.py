"""Scenes for single classes of paths, where mutations have to show their densities.

Edge lengths and cosines vary several times, so that a factor left out of a density does not cancel;
what applies to a path depends on the path. All are 24 × 16 pixels.
"""

from __future__ import annotations

from collections.abc import Callable

from support.scenes import GREY, WHITE, picture_of, sky
from support.shapes import box, facing, floor, orthographic, perspective, quad, sphere, translate
from usdmlt import scene as s

CLASS_SCENES: dict[str, Callable[[], s.Scene]] = {}


def class_scene(function: Callable[[], s.Scene]) -> Callable[[], s.Scene]:
    CLASS_SCENES[function.__name__] = function
    return function


GLASS = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))
WATER = s.Material(s.Dielectric(1.33, 0.0, scatter_mode="RT"))
MIRROR = s.Material(s.Conductor((0.2, 0.4, 1.4), (3.4, 2.3, 1.8), 0.0))
# Below Dirac reflection, so that a walk's stop is a matter of chance.
LACQUER = s.Material(s.Layer(s.Dielectric(1.8, 0.0), s.Diffuse((0.6, 0.5, 0.4))))


@class_scene
def corridor() -> s.Scene:
    """Diffuse walls from 0.7 to 9 units away under a lamp close to one of them: edges of all
    lengths and cosines, no Dirac vertex."""
    return picture_of(
        perspective((0, 0.6, 4), (-0.2, 0.4, 0), 62),
        meshes=[
            quad((-2, 0, 4.5), (4, 0, 0), (0, 0, -9.5), 0),
            quad((-1.2, 0, 4.5), (0, 0, -9.5), (0, 2.5, 0), 1),
            quad((2, -0.2, -5), (-0.8, 0, 8.5), (0, 2.8, 0), 0),
            quad((-2, 0, -5), (4, 0, 0), (0, 2.5, 0.6), 1),
            box((0.2, 0.0, 1.6), (0.7, 0.5, 2.2), 1),
        ],
        materials=[WHITE, GREY],
        lights=[s.RectLight((9, 8, 7), 0.5, 0.8, facing((-1.0, 0.9, 0.5), (0.6, 0.2, 0)))],
    )


def water(camera: s.Camera, lights: list, **others: object) -> s.Scene:
    """A sheet of water over a floor that falls from 0.15 to 2.5 units below it."""
    return picture_of(
        camera,
        meshes=[
            quad((-2.5, -0.15, 2.2), (5, 0, 0), (0, -2.35, -4.4), 0),
            quad((-2.5, 0, 2.2), (5, 0, 0), (0, 0, -4.4), 1),
            *others.pop("meshes", []),
        ],
        materials=[WHITE, WATER, *others.pop("materials", [])],
        lights=lights,
        **others,
    )


POOL_LAMP = s.RectLight((4, 4, 4), 2.2, 2.2, facing((0.6, 2.4, -0.5), (0, 0, 0), (0, 0, 1)))


@class_scene
def pool() -> s.Scene:
    """L S D S E under an area light, the floor at depths that differ 16 times."""
    return water(perspective((0, 1.3, 3.2), (0, -0.3, 0.4), 40), [POOL_LAMP])


@class_scene
def pool_through_a_lens() -> s.Scene:
    """The same seen by a wide lens, lit by a mesh that emits."""
    lamp = s.Material(s.UniformEmission((4, 4, 4)))
    camera = perspective((0, 1.3, 3.2), (0, -0.3, 0.4), 40, lens_radius=0.3, focus_distance=3.0)
    return water(
        camera,
        [],
        meshes=[quad((-0.6, 2.0, -1.4), (2.2, 0.5, 0), (0, 0.2, 2.0), 2)],
        materials=[lamp],
    )


@class_scene
def pool_from_afar() -> s.Scene:
    """The same seen by an orthographic camera, under a dome and a wide sun."""
    return water(
        orthographic((1.5, 2.5, 3), (0, -0.3, 0), 3.0),
        [
            s.DomeLight((0.5, 0.6, 0.8), 0),
            s.DistantLight((30, 26, 20), 14.0, facing((0, 0, 0), (-0.6, -2, -0.5))),
        ],
        textures=[s.Texture(sky())],
    )


@class_scene
def mirrors_and_floor() -> s.Scene:
    """E D S+ L, E D S D L and E S D S D L: inner chains at a mirror and a glass block, whose
    distances from the floor differ."""
    return picture_of(
        perspective((0, 1.6, 4.2), (0, 0.3, 0), 40),
        meshes=[
            floor(0, 2.5),
            quad((-1.8, 0.1, -0.6), (1.6, 0, -0.4), (0, 1.5, -0.5), 1),
            box((0.3, 0.25, -0.4), (1.5, 0.5, 0.6), 2),
            quad((-0.4, 0.02, 0.9), (1.2, 0, 0), (0, 0.2, -0.9), 3),
        ],
        materials=[WHITE, MIRROR, GLASS, LACQUER],
        lights=[s.RectLight((5, 5, 5), 1.8, 1.4, facing((0.5, 2.6, 1.0), (0, 0, 0)))],
    )


@class_scene
def lacquered_floor() -> s.Scene:
    """E D L and E S D L by a smooth coat, seen steeply and at glancing angles: it reflects a tenth
    of the walks, or nearly all."""
    return picture_of(
        perspective((0, 0.35, 2.6), (0, 0.1, 0), 70),
        meshes=[floor(0, 2.5), quad((-2, 0.3, -1.5), (4, 0, 0), (0, 1.4, 0), 1)],
        materials=[LACQUER, WHITE],
        lights=[s.RectLight((5, 5, 5), 1.2, 1.2, facing((0, 1.8, 0.4), (0, 0, 0)))],
    )


@class_scene
def sun_caustics() -> s.Scene:
    """L S D E of a sun without extent and of a wide one, by a tilted mirror and a glass block;
    edges from the mirror to the floor differ 5 times."""
    return picture_of(
        perspective((0, 2.4, 3.4), (0, 0, 0.2), 40),
        meshes=[
            floor(0, 2.5),
            quad((-1.9, 0.2, 0.6), (0, 0, -1.4), (0.7, 1.3, 0), 1),
            box((0.3, 0.3, -0.5), (1.4, 0.6, 0.7), 2),
        ],
        materials=[WHITE, MIRROR, GLASS],
        lights=[
            s.DistantLight((2.5, 2.4, 2.2), 0.0, facing((0, 0, 0), (-1.2, -1, -0.1))),
            s.DistantLight((60, 50, 40), 8.0, facing((0, 0, 0), (-0.8, -1.3, 0.2))),
        ],
    )


@class_scene
def lamp_caustics() -> s.Scene:
    """L S D E and L D S D E of a small lamp close to a mirror and a glass ball, over a floor that
    is far on one side: angles of the caustic perturbation differ many times."""
    return picture_of(
        perspective((0, 2.2, 3.6), (0, 0, 0.2), 44),
        meshes=[
            quad((-2.5, 0.7, 2.5), (5, -2.4, 0), (0, 0, -5), 0),
            quad((-0.2, 1.5, -0.7), (1.2, 0.25, 0), (0, 0, 1.4), 1),
            sphere(0.45, 2, smooth=True, transform=translate(-1.0, 1.0, 0.2)),
        ],
        materials=[WHITE, MIRROR, GLASS],
        lights=[s.DiskLight((9, 9, 9), 0.25, facing((0.1, 0.8, 0), (0.2, 1.6, 0), (0, 0, 1))),
                s.RectLight((6, 6, 6), 0.7, 0.7, facing((-1.3, 2.2, 0), (-1, 1, 0.2), (0, 0, 1)))],
    )  # fmt: skip


@class_scene
def polished() -> s.Scene:
    """L G D E, L D G E and L G D G E: a near-specular ball and plates above a floor that falls away
    from them, under lamps that shine at them; one plate is seen from below."""
    polish = [s.Material(s.Conductor(roughness=r)) for r in (0.12, (0.06, 0.15))]
    lacquer = s.Layer(s.Dielectric(1.6, 0.1), s.Diffuse((0.5, 0.4, 0.4)))
    return picture_of(
        perspective((0, 1.3, 2.6), (0, 0.35, 0), 52),
        meshes=[
            quad((-2.2, 0.5, 1.8), (4.4, -1.6, 0), (0, 0, -4), 0),
            sphere(0.7, 1, smooth=True, transform=translate(-0.5, 0.9, 0.1)),
            quad((0.3, 1.5, -0.8), (1.2, 0.3, 0), (0, 0.2, 1.4), 2),
            quad((0.6, -0.1, 0.9), (0.9, 0, -0.5), (0, 0.6, -0.4), 3),
        ],
        materials=[WHITE, *polish, s.Material(lacquer)],
        lights=[
            s.RectLight((30, 30, 30), 0.4, 0.4, facing((-1.6, 1.0, 1.0), (-0.5, 0.9, 0.1))),
            s.RectLight((20, 20, 20), 0.5, 0.4, facing((0.8, 0.7, 0.3), (0.9, 1.7, -0.1))),
            s.RectLight((6, 6, 7), 0.7, 0.7, facing((0.3, 2.2, 1.2), (-0.2, -0.2, 0.2))),
        ],
    )


@class_scene
def two_plates() -> s.Scene:
    """L G D E, and L G D D G D E with two walks to choose from: the lamp of a white room shines at
    a near-specular floor; a wall is such as well."""
    polish = s.Material(s.Conductor(roughness=0.18))
    lamp = facing((-0.2, 1.4, 0.1), (-0.1, 0, 0), (0, 0, 1))
    return picture_of(
        perspective((0.5, 0.9, 1.3), (-0.4, 0.9, -1), 70),
        meshes=[
            floor(1, 1.0),
            quad((1, 0.4, 0.9), (0, 0, -1.8), (0, 0.9, 0), 1),
            quad((-0.9, 1.7, 0.9), (1.8, 0, 0), (0, 0, -1.9), 0),
            quad((-1, 0.4, 0.9), (0, 0, -1.8), (0, 0.9, 0), 0),
            quad((-0.9, 0.4, -1.1), (1.8, 0, 0), (0, 0.9, 0), 0),
        ],
        materials=[WHITE, polish],
        lights=[s.RectLight((9, 8, 7), 0.3, 0.2, lamp)],
    )


@class_scene
def veils() -> s.Scene:
    """Sheets of partial opacity, one of which emits, over a floor."""
    return picture_of(
        perspective((0, 1.5, 4), (0, 0.4, 0), 42),
        meshes=[
            floor(0, 2.5),
            quad((-1.5, 0.3, 0.8), (1.8, 0, -0.3), (0, 0.9, -0.5), 1),
            quad((-0.2, 0.9, -0.6), (1.5, 0.3, 0), (0, 0.1, 1.4), 2),
        ],
        materials=[
            WHITE,
            s.Material(s.Diffuse((0.7, 0.6, 0.6)), opacity=0.3),
            s.Material(s.Add(s.Diffuse((0.6, 0.6, 0.6)), s.UniformEmission((2, 2, 2))),
                       opacity=0.5),
        ],
        lights=[s.RectLight((8, 8, 8), 0.8, 0.8, facing((0.8, 2.2, 0.8), (0, 0, 0)))],
    )  # fmt: skip


@class_scene
def near_lamps() -> s.Scene:
    """Large lamps close to a floor, sampled by the solid angle they fill: points of one lamp are
    found with very different densities from different places."""
    return picture_of(
        perspective((0, 1.6, 4), (0, 0.2, 0), 44),
        meshes=[floor(0, 2.5), box((-0.4, 0, -0.6), (0.4, 0.5, 0), 1)],
        materials=[WHITE, GREY],
        lights=[
            s.SphereLight((3, 3, 3), 0.7, translate(-1.4, 0.85, 0.3)),
            s.RectLight((3, 3, 2), 1.6, 1.6, facing((1.5, 0.5, 0.2), (0.6, 0.2, 0))),
        ],
    )


@class_scene
def mirrored_light() -> s.Scene:
    """L D S D E: a lamp lights a panel, and only a mirror shows that to the floor, which falls away
    from it; the chain from the floor ends on the panel and is connected to the lamp."""
    return picture_of(
        perspective((0, 0.9, 3.8), (0, -0.3, 0), 46),
        meshes=[
            quad((-2.2, 0.2, 1.6), (4.4, -1.6, 0), (0, 0, -3.2), 0),
            quad((-2.3, 1.0, 1.0), (1.5, 0, 0), (0, 0, -2.0), 1),
            quad((-2.4, 2.3, -1.4), (4.0, 0.5, 0), (0, 0, 2.8), 2),
        ],
        materials=[WHITE, s.Material(s.Diffuse((0.8, 0.7, 0.6))), MIRROR],
        lights=[s.RectLight((40, 40, 40), 0.3, 0.3,
                            facing((-1.6, 1.5, 0.2), (-1.6, 1.0, 0.1), (0, 0, 1)))],
    )  # fmt: skip


@class_scene
def mirror_floor() -> s.Scene:
    """L D S E by a mirror that is looked at from steeply above to all but along it, and D S D in a
    corner: cosines at the Dirac vertices differ 10 times."""
    return picture_of(
        perspective((0, 0.7, 2.0), (0, 0.1, 0.6), 80),
        meshes=[
            quad((-3, 0, 2.4), (6, 0, 0), (0, 0, -6), 1),
            quad((-3, 0, -3.6), (6, 0, 0), (0, 3, 0.8), 0),
            quad((-3, 3, -3.6), (6, 0, 0), (0, -0.5, 6), 0),
            box((-0.9, 0.1, -0.6), (-0.3, 0.6, 0.1), 0),
        ],
        materials=[WHITE, MIRROR],
        lights=[s.RectLight((9, 9, 9), 0.8, 0.8, facing((1.5, 1.2, 0.8), (0, 2, -2)))],
    )
