"""Mirrors and smooth glass: directions, discrete probabilities, and what they carry in both roles.

Components are stored as coefficients of a measure that reflection and refraction leave invariant:
value = R η² or T η_eye², pdf = P |cosθ_sampled| η_sampled² (cpp/materials/closure.hpp).
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import (
    delta_reflection,
    delta_transmission,
    draw,
    mirrored,
    polar,
    probe,
    refracted,
    rows,
)
from usdmlt.scene import (
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Layer,
    Mix,
)

ETA = 1.5
REFLECTION, TRANSMISSION = delta_reflection(0), delta_transmission(0)
COSINES = (1.0, 0.8, 0.3, 0.05, -0.9, -0.75)


def fresnel(cosine: float, eta: float) -> float:
    """Unpolarised reflectance by the complex Fresnel equations; ``cosine`` < 0: from inside."""
    m = eta if cosine > 0 else 1 / eta
    c = abs(cosine)
    t = np.sqrt(complex(1 - (1 - c**2) / m**2))
    s, p = (c - m * t) / (c + m * t), (m * c - t) / (m * c + t)
    return float((abs(s) ** 2 + abs(p) ** 2) / 2)


@pytest.fixture(scope="module")
def glass():
    """A smooth dielectric."""
    return probe(Dielectric(ior=ETA, roughness=0.0, scatter_mode="RT"))


@pytest.mark.parametrize("cosine", COSINES)
def test_glass_reflects_and_refracts_by_snell_and_fresnel(glass, cosine, role):
    known = polar(cosine, 2.0)
    n = 20_000
    s = draw(glass, known, role, n)
    assert s.valid.all()
    reflected = s.components == REFLECTION
    assert (s.components[~reflected] == TRANSMISSION).all()
    assert_allclose(s.directions[reflected], rows(mirrored(known), reflected.sum()), atol=1e-6)
    f = fresnel(cosine, ETA)
    assert abs(reflected.mean() - f) < 4.5 * np.sqrt(f * (1 - f) / n)
    through = refracted(known, ETA)
    assert_allclose(s.directions[~reflected], rows(through, (~reflected).sum()), atol=1e-6)


@pytest.mark.parametrize("cosine", COSINES)
def test_refraction_scales_radiance_and_not_importance(glass, cosine):
    """Catches η² of the wrong side, and η² given to light as well."""
    known = polar(cosine)
    eta_known, eta_other = (1.0, ETA) if cosine > 0 else (ETA, 1.0)
    for role, scale in (("eye", (eta_known / eta_other) ** 2), ("light", 1.0)):
        s = draw(glass, known, role, 500)
        carried = s.throughput()
        across = s.components == TRANSMISSION
        assert_allclose(carried[~across], 1.0, rtol=1e-5)
        assert_allclose(carried[across], scale, rtol=1e-4)


@pytest.mark.parametrize("cosine", COSINES)
def test_stored_coefficients_are_those_of_the_invariant_measure(glass, cosine):
    known = polar(cosine, 1.0)
    f = fresnel(cosine, ETA)
    eta2 = {True: 1.0, False: ETA**2}
    side = cosine > 0
    for component, other, share in (
        (REFLECTION, mirrored(known), f),
        (TRANSMISSION, refracted(known, ETA), 1 - f),
    ):
        a, b = known[None], other[None]
        other_side = other[2] > 0
        assert glass.eta_of_side(b, component)[0] ** 2 == pytest.approx(eta2[other_side])
        # Known light, sampled eye: the value is scaled by the eye's side.
        assert_allclose(glass.evaluate(a, b, component), share * eta2[other_side], rtol=1e-4)
        assert_allclose(glass.evaluate(b, a, component), share * eta2[side], rtol=1e-4)
        expected = share * abs(other[2]) * eta2[other_side]
        for role in ("eye", "light"):
            assert glass.pdf(a, b, role, component)[0] == pytest.approx(expected, rel=1e-4)


def test_beyond_the_critical_angle_all_is_reflected(glass):
    known = polar(-0.5)
    s = draw(glass, known, "eye", 1000)
    assert (s.components == REFLECTION).all()
    assert_allclose(s.throughput(), 1.0, rtol=1e-5)


def test_a_lobe_that_only_transmits_loses_what_would_be_reflected():
    lobe = probe(Dielectric(ior=ETA, roughness=0.0, scatter_mode="T"))
    s = draw(lobe, polar(0.3), "light", 1000)
    assert (s.components == TRANSMISSION).all()
    assert_allclose(s.throughput(), 1 - fresnel(0.3, ETA), rtol=1e-4)
    assert not draw(lobe, polar(-0.5), "light", 1000).valid.any()


@pytest.mark.parametrize("alpha", [0.0, 0.3])
@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.01, -0.01, -0.7])
def test_equal_indices_let_everything_pass_straight_on(alpha, cosine, role):
    """Also with rough microfacets: nothing refracts, so the component is Dirac."""
    lobe = probe(Dielectric(ior=1.0, roughness=alpha, scatter_mode="RT"))
    assert not lobe.has_non_delta
    s = draw(lobe, polar(cosine), role, 200)
    assert (s.components == TRANSMISSION).all()
    assert_allclose(s.directions, rows(-polar(cosine), 200), atol=1e-6)
    assert_allclose(s.throughput(), 1.0, rtol=1e-4)


@pytest.mark.parametrize("ior", [0.0, -1.0, float("nan"), float("inf")])
def test_an_index_that_is_none_is_that_of_glass(ior, glass):
    lobe = probe(Dielectric(ior=ior, roughness=0.0, scatter_mode="RT"))
    assert lobe.lobes == glass.lobes


def test_a_mirror_reflects_its_colour_on_both_sides():
    mirror = probe(GeneralizedSchlick((0.9, 0.6, 0.3), roughness=0.0))
    for cosine in (0.7, -0.7):
        s = draw(mirror, polar(cosine), "eye", 10)
        power = (1 - 0.7) ** 5
        expected = np.array([0.9, 0.6, 0.3]) * (1 - power) + power
        assert_allclose(s.directions, rows(mirrored(polar(cosine)), 10), atol=1e-6)
        assert_allclose(s.throughput(), rows(expected, 10), rtol=1e-5)


def test_polished_metal_reflects_by_the_complex_index():
    eta, k = np.array([0.2, 0.9, 1.4]), np.array([3.9, 2.4, 1.6])
    metal = probe(Conductor(tuple(eta), tuple(k), roughness=0.0))
    for c in (1.0, 0.6, 0.2, 0.02):
        n = eta + 1j * k
        t = np.sqrt(1 - (1 - c**2) / n**2)
        s_wave, p_wave = (c - n * t) / (c + n * t), (n * c - t) / (n * c + t)
        expected = (np.abs(s_wave) ** 2 + np.abs(p_wave) ** 2) / 2
        carried = draw(metal, polar(c), "eye", 1).throughput()
        assert_allclose(carried[0], expected, rtol=2e-4)


def test_dirac_components_need_the_right_side(glass):
    above, also_above, below = polar(0.8)[None], polar(0.6)[None], polar(-0.6)[None]
    assert (glass.evaluate(above, below, REFLECTION) == 0).all()
    assert (glass.evaluate(above, also_above, TRANSMISSION) == 0).all()
    assert glass.pdf(above, below, "eye", REFLECTION)[0] == 0
    assert glass.pdf(above, also_above, "eye", TRANSMISSION)[0] == 0
    # Components of lobes that are not there.
    assert (glass.evaluate(above, also_above, delta_reflection(1)) == 0).all()


def test_dirac_lobes_are_chosen_by_their_share_of_energy():
    """The density of a Dirac component includes the choice among lobes, in both directions."""
    closure = probe(Mix(Dielectric(roughness=0.0), Diffuse((1.0, 1.0, 1.0)), 0.5))
    known = polar(0.2)
    n = 20_000
    s = draw(closure, known, "eye", n)
    component = next(c for c in np.unique(s.components) if c)
    chosen = s.components == component
    pdf = closure.pdf(known[None], mirrored(known)[None], "eye", int(component))[0]
    p = float(pdf) / abs(known[2])
    assert p == pytest.approx(fresnel(0.2, 1.5) / (fresnel(0.2, 1.5) + 1), rel=0.02)
    assert abs(chosen.mean() - p) < 4.5 * np.sqrt(p * (1 - p) / n)


def test_a_smooth_layer_covers_a_smooth_base_once():
    """min(T(l), T(e)) at the mirror direction is T once, not squared."""
    varnished = probe(Layer(Dielectric(roughness=0.0), Conductor(roughness=0.0)))
    bare = probe(Conductor(roughness=0.0))
    known = polar(0.3)
    component = delta_reflection(1)
    assert [x["type"] for x in varnished.lobes] == ["dielectric", "conductor"]
    base = varnished.evaluate(known[None], mirrored(known)[None], component)
    metal = bare.evaluate(known[None], mirrored(known)[None], delta_reflection(0))
    assert_allclose(base, metal * (1 - fresnel(0.3, 1.5)), rtol=1e-4)
