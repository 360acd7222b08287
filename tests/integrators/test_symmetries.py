"""What must not change the picture: the unit of light, of length, and the place in the world."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from support import scenes
from support.rendering import ALL, BOTH, build, picture, pictures, rgba, work
from support.shapes import rotate, scale, translate
from support.statistics import agreement
from usdmlt import scene as s

NAMES = ["diffuse_box", "thin_lens", "dome_and_distant", "instances", "orthographic_camera"]


def moved(scene: s.Scene, m: np.ndarray) -> s.Scene:
    """The whole scene under a similarity."""
    move = lambda x: dataclasses.replace(x, transform=x.transform @ m)  # noqa: E731
    return dataclasses.replace(
        scene,
        camera=move(scene.camera),
        meshes=[move(x) for x in scene.meshes],
        lights=[move(x) for x in scene.lights],
        instances=[dataclasses.replace(x, transforms=x.transforms @ m) for x in scene.instances],
    )


def brighter(scene: s.Scene, factor: float) -> s.Scene:
    lit = [
        dataclasses.replace(x, radiance=tuple(factor * c for c in x.radiance)) for x in scene.lights
    ]
    return dataclasses.replace(scene, lights=lit)


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_light_scales_the_picture(integrator: str, factor: float) -> None:
    """The same decisions are taken, so the picture is the same to rounding."""
    scene = scenes.build("shaped_lights")
    one = picture(scene, integrator, samples=4, depth=4)
    other = picture(brighter(scene, factor), integrator, samples=4, depth=4)
    assert other / factor == pytest.approx(one, rel=1e-4, abs=1e-6 * one.mean())


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("exponent", [-30, 30])
def test_light_scaled_by_a_power_of_two_scales_the_bits(integrator: str, exponent: int) -> None:
    """Such a factor rounds nothing, so not one decision may change, nor alpha: sees absolute
    thresholds, and sums that run out of their range."""
    scene = scenes.build("shaped_lights")
    settings = {"samples": 64 if integrator == "mlt" else 16, "depth": 4}
    one = rgba(scene, integrator, **settings)
    other = rgba(brighter(scene, 2.0**exponent), integrator, **settings)
    assert np.array_equal(other, one * np.float32([2.0**exponent] * 3 + [1]))


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("name", NAMES)
def test_far_from_the_origin(integrator: str, name: str) -> None:
    """A million units away and turned about: positions are recentred before they become float.
    Sees anything that is left in world space, and directions that forget a rotation."""
    scene = scenes.build(name)
    m = rotate((1, 2, 3), 77) @ translate(1e6, -2e6, 3e6)
    here = pictures(scene, integrator, 16, samples=16, depth=4)
    there = pictures(moved(scene, m), integrator, range(100, 116), samples=16, depth=4)
    agreement(here, there).require(resolution=0.02)


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("factor", [1e-3, 1e4])
def test_unit_of_length(integrator: str, name: str, factor: float) -> None:
    """Radiance does not depend on it. Sees fixed distances such as offsets of rays."""
    scene = scenes.build(name)
    one = pictures(scene, integrator, 16, samples=16, depth=4)
    other = pictures(moved(scene, scale(factor)), integrator, range(100, 116), samples=16, depth=4)
    agreement(one, other).require(resolution=0.02)


@pytest.mark.parametrize("integrator", BOTH)
def test_the_mirrored_scene_makes_the_mirrored_picture(integrator: str) -> None:
    """Also the scene's camera is mirrored: its picture is what it was."""
    scene = scenes.build("emission")
    one = pictures(scene, integrator, 16, samples=16, depth=4)
    other = pictures(
        moved(scene, scale(-1, 1, 1)), integrator, range(100, 116), samples=16, depth=4
    )
    agreement(one, other).require(resolution=0.02)


@pytest.mark.parametrize("integrator", BOTH)
def test_exposure_multiplies_the_picture(integrator: str) -> None:
    scene = scenes.build("diffuse_box")
    camera = dataclasses.replace(scene.camera, exposure=4.0)
    one = picture(scene, integrator, samples=2)
    other = picture(dataclasses.replace(scene, camera=camera), integrator, samples=2)
    assert other == pytest.approx(4 * one, rel=1e-6)


# ---------------------------------------------------------------------------------------------
# Chains: the same at sizes that they need


@pytest.mark.parametrize("name", ["thin_lens", "dome_and_distant"])
def test_chains_in_a_scene_turned_moved_and_scaled(name: str) -> None:
    """Perturbations are sized by pixels and by lengths of edges: none by a unit of length, or along
    the world's axes."""
    scene = scenes.build(name)
    m = rotate((1, 2, 3), 77) @ scale(50) @ translate(1e4, -2e4, 3e4)
    here, there = (
        pictures(x, "mlt", seeds, samples=96, depth=4)
        for x, seeds in ((scene, range(16)), (moved(scene, m), range(100, 116)))
    )
    agreement(here, there, lumpy=True).require(resolution=0.015, block_resolution=0.07)


@pytest.mark.parametrize("filter", ["box", "gaussian"])
@pytest.mark.parametrize("integrator", ALL)
def test_a_cropped_picture_is_the_cut_out_of_the_whole(integrator: str, filter: str) -> None:
    """b, moves and the filter's margin are those of the smaller image; the light is the same."""
    scene = scenes.build("caustics")
    camera, (width, height) = scene.camera, (scene.width, scene.height)
    left, right, bottom, top = camera.window
    x0, x1, y0, y1 = 6, 18, 4, 12
    at = lambda a, b, t: a + (b - a) * t  # noqa: E731
    window = (
        at(left, right, x0 / width),
        at(left, right, x1 / width),
        at(top, bottom, y1 / height),
        at(top, bottom, y0 / height),
    )
    cropped = dataclasses.replace(
        scene,
        camera=dataclasses.replace(camera, window=window),
        width=x1 - x0,
        height=y1 - y0,
    )
    settings = {**work(integrator, 16 if integrator == "mlt" else 48), "depth": 4, "filter": filter}
    whole = pictures(build(scene), integrator, 16, **settings)
    part = pictures(build(cropped), integrator, range(100, 116), **settings)
    got = agreement(part, whole[:, y0:y1, x0:x1], lumpy=integrator == "mlt")
    got.require(resolution=0.03, block_resolution=0.08)
