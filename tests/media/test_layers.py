"""Layers where there are media: V of light path expressions, and what the camera's rays meet.

Sums are integers, so what layers share has to be all of the picture to the last bit. That each has
the right part is shown against energies by class of path, summed over subpaths as they were
sampled. Positions and ids are those of the first surface, whatever is before it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import usdmlt
from support.media_scenes import MEDIA_SCENES
from support.rendering import ALL, BOTH, build, layer_sums, picture_sums, plan, rgba
from usdmlt import layers, light_path_layers
from usdmlt import scene as s
from usdmlt.native import core

DEPTH = 6
# Sets of layers that have every path once.
WHOLES = (
    ("lightGroups",),
    ("emission", "direct", "indirect"),
    ("emission", "diffuse", "specular", "transmission", "first=CV.*[LOB]"),
    ("scattered=C.*V.*[LOB]", "clear=C[^V]*[LOB]"),
    ("once=C[^V]*V[^V]*[LOB]", "never=C[^V]*[LOB]", "often=C.*V.*V.*[LOB]"),
    ("LE", "L(D|S|V)+E"),
    ("L(D|S)*E", "L(D|S)*V(D|S|V)*E"),
)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def layered(scene: s.Scene, asked, integrator: str, threads: int = 1, **settings: object):
    """A finished render with layers, and their names."""
    known = light_path_layers.expanded(layers.resolve(asked), scene)
    compiled = light_path_layers.compiled_for(scene, known)
    render = plan(scene, integrator, layers=compiled, **{"depth": DEPTH, **settings})
    render.run(render.units_total, threads)
    return render, [layer.name for layer in known]


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("name", ["glass_ball_in_fog", "smoke", "overlapping", "fire"])
def test_layers_sum_to_the_picture_integer_for_integer(name: str, integrator: str) -> None:
    scene = MEDIA_SCENES[name]()
    asked = list(dict.fromkeys(layer for whole in WHOLES for layer in whole))
    samples = 32 if integrator == "mlt" else 4
    render, names = layered(scene, asked, integrator, samples=samples)
    total = picture_sums(render)
    assert total.any()
    for whole in WHOLES:
        parts = [m.name for m in light_path_layers.expanded(layers.resolve(whole), scene)]
        summed = sum(layer_sums(render, names.index(part)) for part in parts)
        np.testing.assert_array_equal(summed, total, err_msg=str(whole))
    assert layer_sums(render, names.index("scattered")).any()
    plain = plan(scene, integrator, depth=DEPTH, samples=samples)
    plain.run(plain.units_total)
    np.testing.assert_array_equal(render.image(), plain.image())


CLASSES = {"LME": "CV[LOB]", "LMME": "CVV[LOB]", "LDME": "CV<.[DG]>[LOB]", "LMDE": "C<.[DG]>V[LOB]"}


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("name", ["fog_room", "blue_air"])
def test_classes_have_the_energy_of_the_paths_that_are_sampled_so(name: str, integrator: str):
    scene = MEDIA_SCENES[name]()
    built = build(scene)
    tables = [core().class_energies(built, 4000, DEPTH, seed, True) for seed in range(50, 62)]
    expected = np.array([[table.get(c, 0.0) for c in CLASSES] for table in tables])
    found = []
    for seed in range(12):
        render, _ = layered(scene, CLASSES.values(), integrator, seed=seed, samples=24)
        found.append([float((render.layer(i) @ LUMINANCE).mean()) for i in range(len(CLASSES))])
    found = np.array(found)
    assert (expected.mean(0) > 0).all() and (found.mean(0) > 0).all()
    p = stats.ttest_ind(found, expected, axis=0, equal_var=False).pvalue
    error = np.sqrt(found.var(0, ddof=1) / len(found) + expected.var(0, ddof=1) / len(expected))
    assert (error < 0.15 * expected.mean(0))[expected.mean(0) > 0.1 * expected.mean(0).sum()].all()
    assert p.min() * len(p) > 1e-3, dict(zip(CLASSES, p, strict=True))


def test_chains_count_the_energy_of_a_class_as_its_layer_has_it() -> None:
    settings = {"samples": 48, "direct": "mlt", "selective": False}
    render, _ = layered(MEDIA_SCENES["blue_air"](), CLASSES.values(), "mlt", **settings)
    counted = render.stats()["mlt"]["path_class_energy"]
    for i, name in enumerate(CLASSES):
        assert counted[name] > 0, counted
        assert (render.layer(i) @ LUMINANCE).mean() == pytest.approx(counted[name], rel=1e-4)


def without_media(scene: s.Scene) -> s.Scene:
    return replace(
        scene,
        media=[],
        volumes=[],
        world_medium=None,
        meshes=[replace(mesh, medium=None) for mesh in scene.meshes],
        prototypes=[
            s.Prototype([replace(mesh, medium=None) for mesh in prototype.meshes])
            for prototype in scene.prototypes
        ],
    )


@pytest.mark.parametrize("name", ["fog_room", "glass_ball_in_fog", "smoke", "thick_fog", "milk"])
def test_depth_and_ids_are_those_of_the_first_surface(name: str) -> None:
    """As if the air were clear."""
    asked = ("Z", "P", "N", "objectId", "albedo", "CryptoObject")
    settings = {"integrator": "path", "samples": 1, "filter": "box", "aovs": asked}
    scene = MEDIA_SCENES[name]()
    foggy, clear = (usdmlt.render(x, **settings) for x in (scene, without_media(scene)))
    assert np.isfinite(foggy["Z"]).any()
    for layer in foggy.channels:
        if layer.startswith(("Z", "P", "N", "objectId", "albedo", "Crypto")):
            np.testing.assert_array_equal(foggy[layer], clear[layer], err_msg=layer)
    assert not np.array_equal(foggy["color"], clear["color"])


@pytest.mark.parametrize("name", ["fog_room", "smoke", "blue_air"])
def test_alpha_agrees(name: str) -> None:
    """It is the share of camera rays that end at something: a surface, or a point of a medium."""
    built = build(MEDIA_SCENES[name]())
    path, bdpt = (rgba(built, i, samples=256, depth=2)[..., 3] for i in BOTH)
    assert np.abs(path - bdpt).max() < 0.15
    assert abs(path.mean() - bdpt.mean()) < 0.005
