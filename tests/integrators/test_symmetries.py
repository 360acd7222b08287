"""What must not change the picture: the unit of light, of length, and the place in the world."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from support import scenes
from support.rendering import BOTH, picture, pictures
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
