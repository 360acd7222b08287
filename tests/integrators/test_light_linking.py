"""Lights that illuminate some meshes only: one factor of Le(x0 → x1), in every integrator.

Absolute values come from closed forms. Path tracing and bidirectional path tracing are compared on
a scene of all kinds of linked lights in test_path_equals_bdpt, weights in tests/paths, and the
densities and one-step stationarity of mutations in tests/mutations.
"""

from __future__ import annotations

import numpy as np
import pytest

from support.irradiance import ALBEDO, expected_picture, footprints, of_polygon, plane_under
from support.rendering import ALL, BOTH, build, picture, pictures, work
from support.scenes import GREY, SCENES, WHITE, picture_of
from support.shapes import facing, floor, perspective, quad, sphere, translate
from support.statistics import agreement
from usdmlt import scene as s

SQUARE = np.array([[x, y, 0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]) * 0.3


def corners(transform: np.ndarray) -> np.ndarray:
    return SQUARE @ transform[:3, :3] + transform[3, :3]


# No pixel is behind either.
LEFT = facing((-0.5, 1.0, 0.1), (-0.2, 0, 0))
RIGHT = facing((0.6, 0.8, -0.2), (0.5, 0, -0.1))


def two_planes(red: str | None, green: str | None) -> s.Scene:
    """A red light and a green one above two halves of a plane, in the collections far and near."""
    scene = plane_under(s.RectLight((3, 0, 0), 0.6, 0.6, LEFT, light_link=red))
    scene.lights.append(s.RectLight((0, 2, 0), 0.6, 0.6, RIGHT, light_link=green))
    across = ((6, 0, 0), (0, 0, -3))
    scene.meshes = [
        quad((-3, 0, 0), *across, collections=frozenset({"far", "all"})),
        quad((-3, 0, 3), *across, collections=frozenset({"near", "all"})),
    ]
    return scene


@pytest.mark.parametrize(
    ("red", "green"),
    [(None, None), ("far", "near"), ("near", None), ("all", "far"), ("none", "all")],
)
def test_each_plane_has_the_irradiance_of_the_lights_that_are_linked_to_it(red, green) -> None:
    """Lambert's formula, in red for one light and in green for the other; pixels, blocks and means
    at the significance 10⁻³ each."""
    expected = expected_picture(of_polygon(corners(LEFT)), (3, 0, 0))
    expected += expected_picture(of_polygon(corners(RIGHT)), (0, 2, 0))
    rows = footprints()[0][:, 0, 0, 2]
    halves = {None: rows < 9, "all": rows < 9, "none": rows > 9, "far": rows < 0, "near": rows > 0}
    for channel, link in enumerate((red, green)):
        expected[..., channel] *= halves[link][:, None]
    built = build(two_planes(red, green))
    for integrator in ALL:
        got = pictures(built, integrator, 16, depth=2, **work(integrator, 64))
        agreement(got, expected, lumpy=integrator == "mlt").require(resolution=0.01)
        assert not got[:, (expected == 0)].any()


def linked_dome(link: str | None) -> s.Scene:
    """Two domes and a wide sun, which make up one environment."""
    scene = plane_under(s.DomeLight((1, 0, 0), light_link=link))
    scene.lights.append(s.DomeLight((0, 2, 0), light_link="others"))
    scene.lights.append(s.DistantLight((0, 0, 4), 60.0, facing((0, 0, 0), (0, -1, 0), (0, 0, 1))))
    scene.meshes[0].collections = frozenset({"floor"})
    return scene


def test_lights_of_one_environment_have_links_of_their_own() -> None:
    """E = π of a dome, π sin²30° of the sun."""
    built = build(linked_dome("floor"))
    expected = np.array([ALBEDO, 0, ALBEDO])
    for integrator in ALL:
        got = pictures(built, integrator, 8, depth=2, **work(integrator, 32)).mean(axis=(1, 2))
        error = np.maximum(got.std(axis=0, ddof=1) / np.sqrt(8), 1e-6)
        assert (np.abs(got.mean(axis=0) - expected) < 6 * error).all(), integrator
        assert not got[:, 1].any()


def test_a_sun_without_extent_has_links() -> None:
    sun = s.DistantLight((3, 2, 1), 0.0, facing((0, 0, 0), (0.3, -1, 0.2)), light_link="others")
    scene = plane_under(sun)
    for integrator in ALL:
        assert not picture(build(scene), integrator, samples=8, depth=3).any()
    scene.meshes[0].collections = frozenset({"others"})
    expected = np.array(sun.radiance) * ALBEDO / np.pi * sun.transform[2, 1]
    got = picture(scene, "path", samples=4, depth=2)
    assert got == pytest.approx(np.broadcast_to(expected, got.shape), rel=1e-5)
    for integrator in ALL:
        got = picture(scene, integrator, depth=2, **work(integrator, 256))
        assert got.mean(axis=(0, 1)) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("integrator", BOTH)
def test_the_camera_sees_light_that_illuminates_nothing(integrator: str) -> None:
    lamp = s.RectLight((3, 2, 1), 4, 4, facing((0, 0, 0), (0, 0, 1)), light_link="nothing")
    scene = picture_of(perspective((0, 0.5, 4), (0, 0, 0), 30), meshes=[floor(0)], materials=[GREY])
    scene.lights.append(lamp)
    seen = picture(scene, integrator, samples=4)
    assert seen[0] == pytest.approx(np.broadcast_to((3, 2, 1), seen[0].shape))
    assert not seen[-1].any()


@pytest.mark.parametrize("integrator", BOTH)
def test_what_a_light_is_not_linked_to_still_hides_it(integrator: str) -> None:
    scene = plane_under(s.RectLight((3, 3, 3), 1, 1, facing((0, 2, 0), (0, 0, 0), (0, 0, 1))))
    scene.lights[0].light_link = "floor"
    scene.meshes[0].collections = frozenset({"floor"})
    scene.meshes.append(floor(0, y=1.5))
    assert not picture(scene, integrator, samples=16, depth=2).any()


def test_a_link_to_everything_changes_no_bit() -> None:
    """Nor does a link of a light that is not there."""
    plain, linked = SCENES["rough_glass"](), SCENES["rough_glass"]()
    for mesh in linked.meshes:
        mesh.collections = frozenset({"all"})
    linked.lights[0].light_link = "all"
    assert np.array_equal(*(picture(scene, "path", samples=4) for scene in (plain, linked)))
    linked.lights[0].light_link = None
    for integrator in ALL:
        one, other = (picture(scene, integrator, samples=4) for scene in (plain, linked))
        assert np.array_equal(one, other)


def linked_caustic() -> s.Scene:
    """A lamp that shines at a ball of glass alone, through which its light comes to the floor; and
    one for the floor alone."""
    ball = sphere(0.7, 1, rings=10, transform=translate(0, 0.9, 0))
    ball.collections = frozenset({"glass"})
    glass = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))
    over = facing((0.3, 3.0, 0.4), (0, 0.9, 0))
    beside = facing((-2.5, 2.0, 1), (0, 0, 0))
    return picture_of(
        perspective((0, 2.4, 4.5), (0, 0.5, 0), 36),
        meshes=[floor(0, collections=frozenset({"floor"})), ball],
        materials=[WHITE, glass],
        lights=[
            s.RectLight((9, 8, 6), 1.6, 1.6, over, light_link="glass"),
            s.RectLight((2, 3, 4), 1.0, 1.0, beside, light_link="floor"),
        ],
    )


def test_all_integrators_agree_on_a_linked_caustic() -> None:
    """Welch's t-tests of pixels, blocks and the mean at the significance 10⁻³ each; a difference of
    some 4 % of the mean would be seen."""
    built = build(linked_caustic())
    path = pictures(built, "path", 16, samples=256, depth=6)
    bdpt = pictures(built, "bdpt", range(100, 116), samples=64, depth=6)
    mlt = pictures(built, "mlt", range(200, 216), depth=6, **work("mlt", 64))
    agreement(path, bdpt).require(resolution=0.01)
    agreement(mlt, bdpt, lumpy=True).require(resolution=0.01)
    # A third of the picture is the caustic, and the ball hides its lamp from much of the floor.
    unlinked = linked_caustic()
    for light in unlinked.lights:
        light.light_link = None
    assert picture(unlinked, "bdpt", samples=16, depth=6).mean() > 1.2 * bdpt.mean()
