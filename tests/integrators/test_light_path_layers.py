"""Layers of light paths: groups of lights and classes of paths, from every integrator.

The sums of a film are integers, so what layers share among them has to be all of the picture, to
the last bit. That each layer has the right part is shown against estimates that are made apart:
pictures with one light on, or with one lobe; energies by class of path, of the components that
subpaths sampled; the other integrators. Welch's t-tests as of test_path_equals_bdpt, each question
at the significance 10⁻³.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import usdmlt
from support import scenes, transport_scenes
from support.rendering import ALL, BOTH, build, layer_sums, picture_sums, pictures, plan, work
from support.scenes import picture_of
from support.shapes import floor, perspective, quad, sphere, translate
from support.statistics import agreement
from usdmlt import layers, light_path_layers
from usdmlt import scene as s
from usdmlt.native import core

DEPTH = 6
# Sets of layers that have every path once.
WHOLES = (
    ("lightGroups",),
    ("emission", "direct", "indirect"),
    ("emission", "diffuse", "specular", "transmission"),
    ("beside=C.*[OB]", "lights=C.*L"),
    ("LE", "LD(D|S)*E", "LS(D|S)*E"),
    ("first=C.{0,2}[LOB]", "rest=C.{3,}[LOB]"),
)


def scene_of(name: str) -> s.Scene:
    """With lights of two groups, and some of none."""
    scene = (scenes.SCENES | transport_scenes.TRANSPORT_SCENES)[name]()
    for number, light in enumerate(scene.lights):
        light.light_group, light.name = ("key", "", "fill")[number % 3], f"/light{number}"
    return scene


def without_glow(material: s.Material) -> s.Material:
    match material.closure:
        case s.Add(a, s.UniformEmission()):
            return replace(material, closure=a)
    assert not isinstance(material.closure, s.UniformEmission)
    return material


class Layered:
    """A render with layers, by name."""

    def __init__(
        self, scene: s.Scene, asked, integrator: str, threads: int = 1, units=None, **settings
    ):
        self.layers = light_path_layers.expanded(layers.resolve(asked), scene)
        self.names = [layer.name for layer in self.layers]
        compiled = light_path_layers.compiled_for(scene, self.layers)
        settings = {"depth": DEPTH, **settings}
        self.render = plan(scene, integrator, layers=compiled, **settings)
        self.render.run(units or self.render.units_total, threads)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.render.layer(self.names.index(name)).astype(np.float64)

    def sums(self, name: str) -> np.ndarray:
        return layer_sums(self.render, self.names.index(name))


def layer_pictures(scene: s.Scene, layer: str, integrator: str, seeds: range, **settings):
    """One layer of independent renders, (seeds, height, width, 3)."""
    name = layers.parse(layer).name
    return np.stack(
        [Layered(scene, [layer], integrator, seed=seed, **settings)[name] for seed in seeds]
    )


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize(
    "name", ["caustics", "dome_and_distant", "linked_lights", "layers", "opacity", "emission"]
)
def test_layers_sum_to_the_picture_integer_for_integer(name, integrator):
    scene = scene_of(name)
    asked = list(dict.fromkeys(layer for whole in WHOLES for layer in whole))
    settings = {"samples": 32 if integrator == "mlt" else 4}
    layered = Layered(scene, asked, integrator, **settings)
    total = picture_sums(layered.render)
    assert total.any()
    for whole in WHOLES:
        names = [m.name for m in light_path_layers.expanded(layers.resolve(whole), scene)]
        np.testing.assert_array_equal(sum(layered.sums(name) for name in names), total)
    plain = plan(scene, integrator, depth=DEPTH, **settings)
    plain.run(plain.units_total)
    np.testing.assert_array_equal(layered.render.image(), plain.image())


@pytest.mark.parametrize("direct", ["separate", "mlt"])
@pytest.mark.parametrize("selective", [True, False])
def test_all_parts_of_metropolis_light_transport_fill_layers(direct, selective):
    """Direct light by path tracing, what the split leaves to samples, splats, and chains."""
    settings = {"samples": 32, "direct": direct, "selective": selective}
    layered = Layered(scene_of("caustics"), WHOLES[1], "mlt", **settings)
    total = sum(layered.sums(name) for name in WHOLES[1])
    np.testing.assert_array_equal(total, picture_sums(layered.render))


@pytest.mark.parametrize(
    ("integrator", "width", "units"), [("path", 96, 6), ("bdpt", 96, 6), ("mlt", 768, 7)]
)
def test_layers_sum_to_the_picture_within_a_pass(integrator, width, units):
    """Where some pixels have a sample more than others."""
    scene = replace(scene_of("caustics"), width=width, height=width * 3 // 4)
    asked = WHOLES[1]
    layered = Layered(scene, asked, integrator, samples=64, units=units)
    counts = layered.render.film.sample_counts()
    assert 0 < counts.min() < counts.max()
    picture = layered.render.image()[..., :3].astype(np.float64)
    total = sum(layered[name] for name in asked)
    np.testing.assert_allclose(total, picture, rtol=1e-5, atol=1e-6 * picture.max())


@pytest.mark.parametrize("integrator", ALL)
def test_layers_do_not_depend_on_the_number_of_threads(integrator):
    scene = scene_of("caustics")
    one, four = (Layered(scene, ["caustics"], integrator, threads, samples=8) for threads in (1, 4))
    assert one["caustics"].any()
    np.testing.assert_array_equal(one["caustics"], four["caustics"])


@pytest.mark.parametrize(
    ("name", "integrator"),
    [
        *product(["shaped_lights", "dome_and_distant", "linked_lights"], BOTH),
        ("linked_lights", "mlt"),
    ],
)
def test_a_group_is_the_picture_with_its_lights_alone(name, integrator):
    """Domes and suns with an extent are sampled as one environment; still each has its part."""
    scene = scene_of(name)
    alone = replace(
        scene,
        # The others are off, and still hide what is behind them.
        lights=[
            light if light.light_group == "key" else replace(light, radiance=(0.0, 0.0, 0.0))
            for light in scene.lights
        ],
        materials=[without_glow(material) for material in scene.materials],
    )
    settings = work(integrator, 8 if integrator == "mlt" else 24)
    group = layer_pictures(scene, "lightGroup:key", integrator, range(12), **settings)
    agreement(group, pictures(alone, integrator, range(100, 112), depth=DEPTH, **settings)).require(
        resolution=0.04
    )


@pytest.mark.parametrize("integrator", BOTH)
def test_a_light_can_be_told_by_its_path(integrator):
    layered = Layered(
        scene_of("shaped_lights"),
        ["one=C.*<L.'/light0'>", "others=C.*<L.[^'/light0']>", "key=C.*<L.'key'>"],
        integrator,
        samples=4,
    )
    total = picture_sums(layered.render)
    assert layered["one"].any() and layered["others"].any()
    np.testing.assert_array_equal(layered.sums("one") + layered.sums("others"), total)
    assert (layered["key"] >= layered["one"]).all()


def test_what_shines_is_a_light_an_object_or_the_background():
    glow = s.Material(s.UniformEmission((2.0, 3.0, 4.0)))
    meshes = [
        quad((-2, -1, 0), (1, 0, 0), (0, 2, 0), 0),
        replace(quad((-0.5, -1, 0), (1, 0, 0), (0, 2, 0), 0), is_light=True),
    ]
    scene = picture_of(
        perspective((0, 0, 4), (0, 0, 0), 60),
        meshes=meshes,
        materials=[glow],
        lights=[
            s.DomeLight((0.5, 0.5, 0.5)),
            s.RectLight((1.0, 1.0, 1.0), 1.0, 2.0, np.diag([-1, 1, -1, 1]) @ translate(1.5, 0, 0)),
        ],
    )
    image = usdmlt.render(
        scene, samples=1, integrator="path", filter="box", aovs=["CL", "CO", "CB"]
    )
    seen = {name: {tuple(v) for v in image[name].reshape(-1, 3)} for name in ("CL", "CO", "CB")}
    assert seen["CO"] == {(0, 0, 0), (2, 3, 4)}
    assert seen["CL"] == {(0, 0, 0), (2, 3, 4), (1, 1, 1)}
    assert seen["CB"] == {(0, 0, 0), (0.5, 0.5, 0.5)}
    left, right = image["CO"][:, :12], image["CL"][:, 12:]
    assert left.any() and right.any() and not image["CO"][:, 12:].any()


@pytest.mark.parametrize(
    ("layer", "integrator"), [*product(["diffuse", "specular"], BOTH), ("diffuse", "mlt")]
)
def test_lobes_of_one_surface_have_their_own_layers(integrator, layer):
    """A mixture scatters as its parts do one by one; here under direct light."""
    matt = s.Diffuse((0.5, 0.3, 0.2))
    metal = s.Conductor(roughness=0.4)

    def scene(mixture: s.Closure) -> s.Scene:
        return picture_of(
            perspective((0, 1.5, 4), (0, 0.4, 0), 40),
            meshes=[floor(0), sphere(0.7, 0, smooth=True, transform=translate(0, 0.7, 0))],
            materials=[s.Material(mixture)],
            lights=[s.SphereLight((9, 8, 7), 0.8, translate(1.5, 3, 2))],
        )

    both = scene(s.Add(s.Multiply(matt, 0.6), s.Multiply(metal, 0.4)))
    part = scene(s.Multiply(matt, 0.6) if layer == "diffuse" else s.Multiply(metal, 0.4))
    settings = {"depth": 2, **work(integrator, 6 if integrator == "mlt" else 16)}
    of_both = layer_pictures(both, layer, integrator, range(12), **settings)
    # The lamp itself is not in the picture.
    of_part = pictures(part, integrator, range(100, 112), **settings)
    agreement(of_both, of_part).require(resolution=0.03)


@pytest.mark.parametrize(
    ("name", "integrator"),
    [
        ("mirror_caustic_through_a_lens", "bdpt"),
        ("mirror_caustic_through_a_lens", "mlt"),
        ("smooth_glass", "bdpt"),
    ],
)
def test_the_caustic_is_the_same_from_all_integrators(name, integrator):
    scene = scene_of(name)
    path = layer_pictures(scene, "LS+DE", "path", range(16), samples=96)
    other = layer_pictures(scene, "LS+DE", integrator, range(100, 116), **work(integrator, 12))
    assert path.any()
    # In some pixels the path tracer finds nothing at all.
    agreement(path, other).require(resolution=0.06, questions=("blocks", "mean"))


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("name", ["glowing_mesh_and_mirrors", "mirror_caustic_through_a_lens"])
def test_classes_have_the_energy_of_the_paths_that_are_sampled_so(name, integrator):
    """Against sums over subpaths, by the components that were sampled: t-tests of every class."""
    from scipy import stats

    scene = scene_of(name)
    classes = ["LDE", "LSE", "LDDE", "LSDE", "LDSE", "LSSE"]
    built = build(scene)
    tables = [core().class_energies(built, 3000, DEPTH, seed, True) for seed in range(50, 62)]
    weights = np.array([0.2126, 0.7152, 0.0722])
    energies = []
    for seed in range(12):
        layered = Layered(scene, classes, integrator, seed=seed, samples=48)
        energies.append([float((layered[name] @ weights).mean()) for name in classes])
    expected = np.array([[table.get(name, 0.0) for name in classes] for table in tables])
    found = np.array(energies)
    there = expected.mean(0) > 1e-2 * expected.mean(0).sum()
    assert np.count_nonzero(there) >= 3
    p = stats.ttest_ind(found[:, there], expected[:, there], axis=0, equal_var=False).pvalue
    error = np.sqrt(found.var(0, ddof=1) / len(found) + expected.var(0, ddof=1) / len(expected))
    assert (error < 0.1 * expected.mean(0) + 1e-9)[expected.mean(0) > 0.1 * expected.mean()].all()
    assert p.min() * len(p) > 1e-3, dict(zip(np.array(classes)[there], p, strict=True))


def test_chains_count_the_energy_of_a_class_as_its_layer_has_it():
    scene = scene_of("pool")
    classes = ["LSE", "LSDSE", "LSDSSE"]
    layered = Layered(scene, classes, "mlt", samples=64, direct="mlt", selective=False)
    counted = layered.render.stats()["mlt"]["path_class_energy"]
    weights = np.array([0.2126, 0.7152, 0.0722])
    for name in classes:
        assert counted[name] > 0, counted
        assert (layered[name] @ weights).mean() == pytest.approx(counted[name], rel=1e-4)
