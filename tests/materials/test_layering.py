"""Layers, mixes, sums and products: what the combination of closures means."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import albedo, polar, probe, random_directions
from usdmlt.scene import (
    Add,
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Layer,
    Mix,
    Multiply,
    Translucent,
    UniformEmission,
)

COAT = Dielectric(roughness=0.3)
BASE = Diffuse((0.8, 0.5, 0.2))
PLASTIC = Layer(COAT, BASE)
METAL = Conductor(roughness=0.4)
WHITE = (1.0, 1.0, 1.0)


@pytest.fixture(scope="module")
def value():
    """f of a closure at random pairs of directions, (n, 3)."""
    light, eye = random_directions(2000, seed=1), random_directions(2000, seed=2)
    light[:, 2], eye[:, 2] = np.abs(light[:, 2]), np.abs(eye[:, 2])
    return lambda closure: np.asarray(probe(closure).evaluate(light, eye), np.float64)


def assert_same(a: np.ndarray, b: np.ndarray, rtol: float = 1e-4) -> None:
    """Equal but for rounding, and not all zero."""
    assert (a > 0).any()
    assert_allclose(a, b, rtol=rtol, atol=1e-6)


def test_closures_add_mix_and_scale_linearly(value):
    assert_same(value(Add(BASE, METAL)), value(BASE) + value(METAL))
    assert_same(value(Mix(BASE, METAL, 0.3)), 0.3 * value(BASE) + 0.7 * value(METAL))
    assert_same(value(Multiply(METAL, 0.4)), 0.4 * value(METAL))
    tint = np.array([0.9, 0.1, 0.5])
    assert_same(value(Multiply(METAL, tuple(tint))), tint * value(METAL))


def test_scaling_layer_and_base_together_does_not_change_what_the_layer_lets_through(value):
    """Catches covers that forget the factor: base brighter under a faded layer."""
    tint = np.array([0.9, 0.1, 0.5])
    assert_same(value(Multiply(PLASTIC, tuple(tint))), tint * value(PLASTIC))
    assert_same(value(Mix(PLASTIC, METAL, 0.2)), 0.2 * value(PLASTIC) + 0.8 * value(METAL))
    assert_same(value(Mix(METAL, PLASTIC, 0.2)), 0.2 * value(METAL) + 0.8 * value(PLASTIC))
    nested = Multiply(Mix(Multiply(PLASTIC, 0.5), PLASTIC, 0.5), 0.5)
    # One layer's mean passage comes from a table, that of several from a quadrature.
    assert_same(value(nested), 0.375 * value(PLASTIC), rtol=2e-3)


def test_layers_are_associative(value):
    top = GeneralizedSchlick((0.3, 0.2, 0.1), roughness=0.2)
    for base in (METAL, BASE):
        assert_same(value(Layer(Layer(top, COAT), base)), value(Layer(top, Layer(COAT, base))))


def test_a_layer_of_nothing_changes_nothing(value):
    assert_same(value(Layer(Dielectric(roughness=0.3, weight=0.0), BASE)), value(BASE))
    assert_same(value(Layer(UniformEmission(), BASE)), value(BASE))
    assert_same(value(Layer(Mix(COAT, METAL, 0.0), BASE)), value(METAL))


@pytest.mark.parametrize(
    "top",
    [
        Diffuse((0.0, 0.0, 0.0)),
        Diffuse((0.9, 0.1, 0.1)),
        Translucent((0.1, 0.2, 0.3)),
        METAL,
        Dielectric(roughness=0.3, scatter_mode="RT"),
        Dielectric(roughness=0.3, scatter_mode="T"),
    ],
    ids=lambda c: f"{type(c).__name__}-{getattr(c, 'scatter_mode', '')}",
)
def test_opaque_and_refracting_layers_hide_their_base(top, value):
    hidden = value(Layer(top, GeneralizedSchlick(WHITE, roughness=0.5)))
    assert_allclose(hidden, value(top), atol=1e-6)
    # … as far as they cover it.
    half = Multiply(top, 0.5)
    assert_same(value(Layer(half, METAL)), value(half) + 0.5 * value(METAL))


def test_a_specular_base_is_covered_by_the_smaller_passage(value):
    """min(T(l), T(e)), T = 1 − E of the layer, from the layer's own quadrature."""
    light, eye = polar(0.9, 0.3), polar(0.35, 3.0)
    e_light, e_eye = (albedo(probe(COAT), w, "eye") for w in (light, eye))
    pair = light[None], eye[None]
    top, base = (probe(c).evaluate(*pair)[0] for c in (COAT, METAL))
    both = probe(Layer(COAT, METAL)).evaluate(*pair)[0]
    assert_allclose(both - top, base * (1 - np.maximum(e_light, e_eye)), rtol=5e-3)


def test_a_diffuse_base_is_covered_both_ways_and_normalised():
    """T(l) T(e) / T_avg: Kelemen and Szirmay-Kalos' coupling, by quadrature."""
    coat = probe(COAT)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    cosines = (nodes + 1) / 2
    through = [1 - albedo(coat, polar(c), "eye")[0] for c in cosines]
    average = float((np.array(through) * cosines * weights).sum())
    light, eye = polar(0.9, 0.3), polar(0.35, 3.0)
    t = [1 - albedo(coat, w, "eye")[0] for w in (light, eye)]
    pair = light[None], eye[None]
    base = probe(PLASTIC).evaluate(*pair)[0] - coat.evaluate(*pair)[0]
    assert_allclose(base, np.array(BASE.color) / np.pi * t[0] * t[1] / average, rtol=5e-3)


def test_the_tint_of_a_layer_does_not_brighten_its_base(value):
    """As ND_dielectric_bsdf: the weight covers the base, the tint only colours the reflection."""
    tinted = Dielectric(roughness=0.3, tint=(0.2, 1.0, 0.2))
    under = value(PLASTIC) - value(COAT)
    assert_same(value(Layer(tinted, BASE)) - value(tinted), under)


def test_emission_passes_layers_and_follows_mixes_and_products():
    glow = UniformEmission((3.0, 2.0, 1.0))
    expected = np.array(glow.color)
    for closure, scale in (
        (glow, 1.0),
        (Layer(COAT, glow), 1.0),
        (Layer(glow, BASE), 1.0),
        (Add(glow, glow), 2.0),
        (Mix(glow, BASE, 0.25), 0.25),
        (Mix(BASE, glow, 0.25), 0.75),
        (Multiply(glow, 0.5), 0.5),
        (Multiply(Add(PLASTIC, glow), 0.5), 0.5),
    ):
        p = probe(closure)
        assert p.is_emissive
        assert_allclose(p.emission, scale * expected)
        assert_allclose(p.emission_alone, scale * expected)
