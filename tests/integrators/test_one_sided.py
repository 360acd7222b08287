"""Surfaces that are there for what sees their front, the eye being where one looks from.

The rule is one of directions, and not symmetric: a floor sees the sky through the back of a roof
above it, whereas light that comes down meets the roof's front. f(x) asks it of the way from the eye
to the light, whichever way a path was made. Numbers here are closed forms; all strategies are
compared in test_path_equals_bdpt and tests/paths, mutations in tests/mutations.
"""

from __future__ import annotations

import numpy as np
import pytest

from support.irradiance import ALBEDO, expected_picture, of_polygon, plane_under
from support.rendering import ALL, BOTH, build, picture, pictures, rgba, work
from support.scenes import GREY, SCENES, picture_of
from support.shapes import facing, perspective, quad, rotate, scale, translate
from support.statistics import agreement
from usdmlt import scene as s

MIRROR = scale(-1, 1, 1)
TURN = rotate((0, 1, 0), 180)


def panel(transform: np.ndarray, placed: str) -> dict:
    """A one-sided quad whose outside is local +z, as a mesh, or once and again as an instance."""
    front = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), double_sided=False)
    if placed == "mesh":
        front.transform = transform
        return {"meshes": [front]}
    placements = np.array([transform, translate(50, 0, 0)])
    return {"prototypes": [s.Prototype([front])], "instances": [s.Instances(0, placements)]}


@pytest.mark.parametrize("placed", ["mesh", "instance"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_quad_is_seen_from_its_front_alone(placed: str, mirrored: bool) -> None:
    """Grey under a dome of radiance 1: radiance ½ from the front; from behind it, the dome. A
    mirroring transform does not turn the outside in."""
    camera = perspective((0, 0, 3), (0, 0, 0), 25)
    flip = MIRROR if mirrored else np.eye(4)
    for transform, shows in ((flip, True), (flip @ TURN, False)):
        scene = picture_of(camera, materials=[GREY], lights=[s.DomeLight((1, 1, 1))],
                           **panel(transform, placed))  # fmt: skip
        for integrator in BOTH:
            seen = rgba(scene, integrator, samples=64, depth=4)
            assert (seen[..., 3] == (1 if shows else 0)).all(), integrator
            assert seen[..., :3].mean() == pytest.approx(0.5 if shows else 1.0, rel=0.01)
        mlt = picture(scene, "mlt", depth=4, **work("mlt", 64))
        assert mlt.mean() == pytest.approx(0.5 if shows else 1.0, rel=0.01)


LAMP = facing((0.2, 1.4, 0.1), (0, 0, 0))
CORNERS = np.array([[x, y, 0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]) * 0.3


def under_a_roof(light: s.Light, faces_up: bool, material: int = 0) -> s.Scene:
    scene = plane_under(light)
    w = 1e4
    v = (0, 0, -2 * w if faces_up else 2 * w)
    roof = quad((-w, 0.5, w if faces_up else -w), (2 * w, 0, 0), v)
    roof.materials, roof.double_sided = material, False
    # The camera looks from below it.
    assert scene.camera.transform[3, 1] < 0.5
    scene.meshes.append(roof)
    return scene


def test_shadows_are_cast_on_what_sees_the_front() -> None:
    """A roof that faces up leaves the floor below it the irradiance of the bare lamp, one that
    faces down leaves it none; pixels, blocks and means at the significance 10⁻³ each."""
    lamp = s.RectLight((3, 2, 1), 0.6, 0.6, LAMP)
    corners = CORNERS @ LAMP[:3, :3] + LAMP[3, :3]
    expected = expected_picture(of_polygon(corners), lamp.radiance)
    through, under = (build(under_a_roof(lamp, faces_up)) for faces_up in (True, False))
    for integrator in ALL:
        got = pictures(through, integrator, 16, depth=2, **work(integrator, 64))
        agreement(got, expected, lumpy=integrator == "mlt").require(resolution=0.01)
        assert not picture(under, integrator, samples=16, depth=2).any()


@pytest.mark.parametrize(
    "light",
    [s.DomeLight((1, 1, 1)), s.DistantLight((1, 1, 1), 0.0, rotate((1, 0, 0), -90))],
    ids=["dome", "sun"],
)
def test_light_from_infinity_comes_through_backs(light: s.Light) -> None:
    expected = ALBEDO if isinstance(light, s.DomeLight) else ALBEDO / np.pi
    for integrator in ALL:
        got = picture(under_a_roof(light, True), integrator, depth=2, **work(integrator, 128))
        assert got.mean() == pytest.approx(expected, rel=0.01)
        assert not picture(under_a_roof(light, False), integrator, samples=16, depth=2).any()


def test_a_veil_counts_where_its_front_is_seen() -> None:
    """Half opaque: half of the light passes its front, all of it its back."""
    dome = s.DomeLight((1, 1, 1))
    for faces_up, expected in ((True, ALBEDO), (False, ALBEDO / 2)):
        scene = under_a_roof(dome, faces_up, material=1)
        scene.materials.append(s.Material(None, opacity=0.5))
        for integrator in ALL:
            got = picture(scene, integrator, depth=2, **work(integrator, 128))
            assert got.mean() == pytest.approx(expected, rel=0.01)


def test_meshes_glow_to_their_front() -> None:
    """A lamp that faces the floor has the irradiance of its polygon; turned, it gives no light."""
    glow = s.Material(s.UniformEmission((2, 2, 2)))
    for faces_down in (True, False):
        scene = plane_under(s.DomeLight((0, 0, 0)))
        scene.materials.append(glow)
        corners = [(-0.4, 0.9, 0.3), (0.2, 0.8, -0.7), (0.9, 1.2, 0.2)]
        points = np.array(corners if faces_down else corners[::-1], np.float32)
        assert (np.cross(*(points[1:] - points[0]))[1] < 0) == faces_down
        scene.meshes.append(s.Mesh(points, np.array([[0, 1, 2]], np.int32), materials=1))
        scene.meshes[-1].double_sided = False
        built = build(scene)
        for integrator in ALL:
            if not faces_down:
                assert not picture(built, integrator, samples=16, depth=2).any()
                continue
            got = pictures(built, integrator, 16, depth=2, **work(integrator, 64))
            expected = expected_picture(of_polygon(np.array(corners)), (2, 2, 2))
            agreement(got, expected, lumpy=integrator == "mlt").require(resolution=0.015)


def test_chains_make_the_same_picture() -> None:
    """As bidirectional path tracing does; Welch's t-tests at the significance 10⁻³ each."""
    built = build(SCENES["one_sided"]())
    bdpt = pictures(built, "bdpt", 16, samples=48, depth=6)
    mlt = pictures(built, "mlt", range(100, 116), depth=6, **work("mlt", 64))
    agreement(mlt, bdpt, lumpy=True).require(resolution=0.012)
