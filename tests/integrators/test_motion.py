"""Motion blur in pictures: coverage against integrals over the time that the shutter is open.

An orthographic picture's alpha is the fraction of the time in which something covers a
point of the pixel. The samples are stratified; tolerances are five times the standard error of
independent ones, so that what they could miss is an error of some hundredths in single pixels and
of half a hundredth of the mean.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from support.rendering import ALL, build, picture, rgba, work
from support.scenes import motion
from support.shapes import box, orthographic, perspective, quad, rotate, sphere, translate
from usdmlt import scene as s

SIZE, VIEW = 24, 4.0
SAMPLES = 1024
GREY = [s.Material(s.Diffuse((0.5, 0.5, 0.5)))]
LIGHT = [s.RectLight((1, 1, 1), transform=translate(0, 0, 50))]


def seen(*meshes: s.Mesh, camera: s.Camera | None = None, **content: object) -> np.ndarray:
    """(SIZE, SIZE) coverage of a view of 4 × 4 units about the origin, from +z; row 0 on top."""
    camera = camera or orthographic((0, 0, 10), (0, 0, 0), VIEW, aspect=1)
    scene = s.Scene(
        camera=camera,
        width=SIZE,
        height=SIZE,
        meshes=list(meshes),
        materials=GREY,
        lights=LIGHT,
        **content,
    )
    return rgba(scene, "path", samples=SAMPLES, depth=1)[..., 3].astype(float)


def average(inside, times: int = 4096, across: int = 8) -> np.ndarray:
    """The fraction of time and pixel in which inside(x, y, t); t in [0, 1]."""
    fine = (np.arange(SIZE * across) + 0.5) / (SIZE * across) * VIEW - VIEW / 2
    x, y = np.meshgrid(fine, fine[::-1])
    # Each cell of a pixel has points and times of its own, the times spread evenly.
    count = times // across**2
    total = np.zeros_like(x)
    rng = np.random.default_rng(0)
    for i in range(count):
        dx, dy = (rng.random((2, *x.shape)) - 0.5) * VIEW / (SIZE * across)
        total += inside(x + dx, y + dy, (i + rng.random(x.shape)) / count)
    return total.reshape(SIZE, across, SIZE, across).mean(axis=(1, 3)) / count


def require_equal(found: np.ndarray, expected: np.ndarray) -> None:
    error = np.sqrt(expected * (1 - expected) / SAMPLES)
    assert np.abs(found - expected).max() <= 5 * error.max() + 0.01
    assert abs(found.mean() - expected.mean()) <= 0.006 * expected.mean()


def moved(mesh: s.Mesh, *later: np.ndarray) -> s.Mesh:
    values = None if mesh.normals is None else mesh.normals.values
    mesh.motion = [s.MeshStep(mesh.points, values, transform) for transform in later]
    return mesh


def test_a_moving_sphere_covers_its_chord_s_share_of_the_time() -> None:
    """A disk of radius r passes from x = −1 to 1: at (x, y) it is there while |x − c| < √(r² − y²),
    of which the interval of c has the overlap's share."""
    radius = 0.6
    ball = sphere(radius, rings=128, transform=translate(-1, 0, 0))
    found = seen(moved(ball, translate(1, 0, 0)))

    across = 16
    fine = (np.arange(SIZE * across) + 0.5) / (SIZE * across) * VIEW - VIEW / 2
    x, y = np.meshgrid(fine, fine[::-1])
    half = np.sqrt(np.maximum(radius**2 - y**2, 0))
    share = np.maximum(np.minimum(x + half, 1) - np.maximum(x - half, -1), 0) / 2
    expected = share.reshape(SIZE, across, SIZE, across).mean(axis=(1, 3))
    require_equal(found, expected)
    assert found.mean() * VIEW**2 == pytest.approx(math.pi * radius**2, rel=3e-3)


def test_steps_are_equidistant_and_straight_between() -> None:
    """Down, up to the right in half the time, and back: a quad along three lines."""
    corners = np.array([(-1, -1), (0, 0.5), (0.5, 0.5), (-1, 0)])
    square = quad((-0.4, -0.4, 0), (0.8, 0, 0), (0, 0.8, 0))
    square.transform = translate(*corners[0], 0)
    found = seen(moved(square, *(translate(*corner, 0) for corner in corners[1:])))

    def inside(x: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
        cx, cy = (np.interp(3 * t, range(4), corners[:, i]) for i in range(2))
        return (np.abs(x - cx) < 0.4) & (np.abs(y - cy) < 0.4)

    require_equal(found, average(inside))


def test_points_move_apart_from_each_other() -> None:
    """A square whose right side runs away grows to a wide rectangle."""
    square = quad((-1.5, -0.5, 0), (1, 0, 0), (0, 1, 0))
    wide = square.points + np.array([(0, 0, 0), (2, 0, 0), (2, 0, 0), (0, 0, 0)], np.float32)
    square.motion = [s.MeshStep(wide)]

    def inside(x: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
        return (np.abs(y) < 0.5) & (x > -1.5) & (x < -0.5 + 2 * t)

    require_equal(seen(square), average(inside))


@pytest.mark.parametrize("steps", [1, 12])
def test_matrices_of_instances_are_interpolated(steps: int) -> None:
    """Two bars about the view's center turn by 60 degrees: in one step their corners cut across,
    which 12 steps do not show."""
    bar = s.Prototype([box((0.3, -0.2, -0.1), (1.6, 0.2, 0.1))])
    turns = np.radians(np.linspace(0, 60, steps + 1))

    def placed(angle: float) -> np.ndarray:
        degrees = math.degrees(angle)
        return np.array([rotate((0, 0, 1), degrees), rotate((0, 0, 1), degrees + 180)])

    motion = np.array([placed(angle) for angle in turns[1:]])
    instances = [s.Instances(0, placed(0), motion=motion)]
    found = seen(prototypes=[bar], instances=instances)

    def inside(x: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
        # The inverse of the interpolated matrix c −s / s c.
        c = np.interp(t * steps, range(steps + 1), np.cos(turns))
        sine = np.interp(t * steps, range(steps + 1), np.sin(turns))
        d = c * c + sine * sine
        u, v = (c * x + sine * y) / d, (-sine * x + c * y) / d
        return (np.abs(u) > 0.3) & (np.abs(u) < 1.6) & (np.abs(v) < 0.2)

    require_equal(found, average(inside))


def test_a_camera_that_moves_sees_the_world_move_the_other_way() -> None:
    still = quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))
    camera = orthographic((0, 0, 10), (0, 0, 0), VIEW, aspect=1)
    camera.motion = [translate(-1, 0.5, 0) @ camera.transform]
    square = quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))
    np.testing.assert_allclose(
        seen(still, camera=camera), seen(moved(square, translate(1, -0.5, 0))), atol=0.08
    )


def test_what_moves_with_the_camera_is_sharp() -> None:
    """Lens, clipping planes and a square in focus are carried along and turned together."""
    camera = perspective((0, 0, 4), (0, 0, 0), 40, 1, lens_radius=0.3, focus_distance=4)
    camera.clipping_planes = np.array([[1.0, 0.0, 0.0, 0.0]])  # the left half is cut off
    square = quad((-0.75, -0.5, 0), (1.5, 0, 0), (0, 1, 0))
    sharp = seen(square, camera=camera)
    carried = [
        rotate((0, 1, 0), 3.0 * i) @ rotate((1, 0, 0), 2.0 * i) @ translate(0.4 * i, 0.1 * i, 0)
        for i in range(4)
    ]
    camera.motion = [camera.transform @ m for m in carried[1:]]
    found = seen(moved(square, *carried[1:]), camera=camera)
    assert 0.02 < sharp.mean() < 0.5
    # Between steps matrices of the square are straight, those of the camera orthonormal.
    assert np.abs(found - sharp).max() < 0.05


@pytest.mark.parametrize("integrator", ALL)
def test_threads_make_the_same_bits(integrator: str) -> None:
    built = build(motion())
    one, *others = (
        picture(built, integrator, threads=n, depth=5, seed=5, **work(integrator, 8))
        for n in (1, 2, 3)
    )
    for other in others:
        np.testing.assert_array_equal(one, other)


def test_vertices_are_on_what_they_hit_at_their_time() -> None:
    """Rays at a time meet the surface as it is then."""
    ball = sphere(1, rings=64, smooth=True, transform=translate(-1, 0, 0))
    built = build(s.Scene(meshes=[moved(ball, translate(1, 0, 0))], materials=GREY))
    assert built.has_motion
    for time in (0.0, 0.3, 0.5, 1.0):
        center = 2 * time - 1
        hits = built.intersect(np.array([[center + 0.6, 0, 5]]), np.array([[0, 0, -1.0]]), time)
        assert hits["distance"][0] == pytest.approx(5 - 0.8, abs=2e-3)
        np.testing.assert_allclose(hits["normal"][0], (0.6, 0, 0.8), atol=3e-3)
        beside = built.intersect(np.array([[center + 1.1, 0, 5]]), np.array([[0, 0, -1.0]]), time)
        assert np.isinf(beside["distance"][0])


@pytest.mark.parametrize("steps", [(3, 2), (5, 1)])
def test_motion_that_does_not_fit_is_refused(steps: tuple[int, int]) -> None:
    square = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    square.motion = [s.MeshStep(np.zeros((steps[0], 3), np.float32))]
    with pytest.raises(ValueError, match="number of points changes"):
        build(s.Scene(meshes=[square], materials=GREY))
