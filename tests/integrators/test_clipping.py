"""What a camera does not see for its clipping range and planes, by every integrator.

A diffuse wall is lit by a sphere in front of it; a black board stands between the camera and both,
so that it shadows nothing. Where the board is clipped the wall is seen as if there were no board:
by rays from the lens and by light that is connected to it.
"""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import ALL, build, picture, pictures, work
from support.shapes import facing, orthographic, perspective, quad, translate
from support.statistics import agreement, standard_errors
from usdmlt import scene as s

SIZE = 12


def view(kind: str, **clipping: object) -> s.Camera:
    """From z = 4 towards the wall at z = 0; about 2 wide there."""
    if kind == "orthographic":
        return orthographic((0, 0, 4), (0, 0, 0), 2.0, 1.0, **clipping)
    return perspective((0, 0, 4), (0, 0, 0), 28.0, 1.0, **clipping)


def wall_behind_a_board(camera: s.Camera, board: bool = True) -> s.Scene:
    """The board is at z = 2, the light at z = 1."""
    wall = quad((-3, -3, 0), (6, 0, 0), (0, 6, 0))
    meshes = [wall]
    if board:
        meshes.append(quad((-3, -3, 2), (6, 0, 0), (0, 6, 0), 1))
    return s.Scene(
        camera,
        SIZE,
        SIZE,
        meshes=meshes,
        materials=[s.Material(s.Diffuse((0.8, 0.8, 0.8))), s.Material(None)],
        lights=[s.SphereLight((5.0, 5.0, 5.0), radius=0.2, transform=translate(0, 0, 1))],
    )


def shots(camera: s.Camera, integrator: str, board: bool = True) -> np.ndarray:
    scene = build(wall_behind_a_board(camera, board))
    return pictures(scene, integrator, 8, depth=3, **work(integrator, 32))


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("integrator", ALL)
def test_before_the_near_plane_nothing_is_seen_and_nothing_hides(integrator, kind):
    """The board at distance 2 is nearer than 2.5; the light, at 3, is not."""
    clipped = shots(view(kind, clipping=(2.5, 100.0)), integrator)
    free = shots(view(kind), integrator, board=False)
    assert free.mean() > 0.1
    agreement(clipped, free, lumpy=integrator == "mlt").require(resolution=0.03)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("integrator", ALL)
def test_an_oblique_plane_opens_the_view_of_the_wall_on_one_side(integrator, kind):
    """-x - z - 2 >= 0 in the camera's space leaves x <= 0 of the board, at z = -2, and x <= 1 and
    x <= 2 at the light's and the wall's depth: all of them that the picture has."""
    planes = np.array([[-1.0, 0.0, -1.0, -2.0]])
    clipped = shots(view(kind, clipping_planes=planes), integrator)
    free = shots(view(kind), integrator, board=False)
    left, right = np.split(clipped, 2, axis=2)
    assert (left == 0).all()  # the board
    shown = agreement(right, np.split(free, 2, axis=2)[1], lumpy=integrator == "mlt")
    shown.require(resolution=0.04)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("integrator", ALL)
def test_beyond_the_far_plane_nothing_is_seen(integrator, kind):
    """Clipped at 3.5 the wall is gone, and the light, at 3, is left."""
    scene = wall_behind_a_board(view(kind, clipping=(0.0, 3.5)), board=False)
    got = picture(build(scene), integrator, depth=3, **work(integrator, 32))
    rows, columns = np.nonzero(got[..., 0])
    assert len(rows) > 0
    middle = (SIZE - 1) / 2
    assert np.abs(rows - middle).max() < 3 and np.abs(columns - middle).max() < 3


def test_several_planes_leave_their_intersection():
    """A window of planes x > -0.25, x < 0.25 at every distance of an orthographic camera."""
    planes = np.array([[1.0, 0, 0, 0.25], [-1.0, 0, 0, 0.25]])
    scene = wall_behind_a_board(view("orthographic", clipping_planes=planes), board=False)
    seen = picture(build(scene), "path", samples=16, depth=2).sum(axis=(0, 2)) > 0
    # Twelve columns from -1 to 1: those between ±0.25 are 5, 6 and parts of 4 and 7.
    np.testing.assert_array_equal(np.nonzero(seen)[0], [4, 5, 6, 7])


def test_the_camera_s_place_and_direction_count():
    """The same view from elsewhere: planes are in the camera's space."""
    moved = facing((10, 0, 0), (6, 0, 0))
    planes = np.array([[-1.0, 0.0, -1.0, -2.0]])
    camera = view("perspective", clipping_planes=planes)
    here = wall_behind_a_board(camera)
    to_there = np.linalg.inv(camera.transform) @ moved
    there = wall_behind_a_board(s.Camera(moved, window=camera.window, clipping_planes=planes))
    for thing in (*there.meshes, *there.lights):
        thing.transform = thing.transform @ to_there
    a, b = (pictures(build(scene), "path", 8, samples=32, depth=2) for scene in (here, there))
    assert a.mean() > 0.05
    assert np.abs(standard_errors(a.mean(axis=(1, 2, 3)), b.mean())) < 6
    agreement(a, b).require(resolution=0.03)
