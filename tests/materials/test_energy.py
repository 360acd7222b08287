"""White furnaces: what comes in goes out, or less; never more.

Energy is what samples of the direction to the eye carry, given the direction to the light.
Radiance is what they carry given the eye; below the surface of a refracting closure it is weighted
by η², the radiance of a furnace inside the medium.
"""

import numpy as np
import pytest
from scipy.special import gammaln

from support.scattering import albedo, draw, polar, probe
from usdmlt.scene import (
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Layer,
    Mix,
    PreviewSurface,
    Sheen,
    Translucent,
)

WHITE = (1.0, 1.0, 1.0)
WHITE_MIRROR = GeneralizedSchlick(WHITE, WHITE, roughness=0.0)
COSINES = (0.98, 0.7, 0.3, 0.1, -0.2, -0.6, -0.95)
SAMPLES = 20_000

LOSSLESS = {
    "lambert": Diffuse(WHITE),
    "rough diffuse that keeps energy": Diffuse(WHITE, roughness=0.8, energy_compensation=True),
    "translucent": Translucent(WHITE),
    "mirror": WHITE_MIRROR,
    "smooth dielectric": Dielectric(roughness=0.0, scatter_mode="RT"),
    "smooth dielectric, rarer inside": Dielectric(ior=0.7, roughness=0.0, scatter_mode="RT"),
    "smooth Schlick": GeneralizedSchlick((0.04,) * 3, roughness=0.0, scatter_mode="RT"),
    "no interface": Dielectric(ior=1.0, roughness=0.2, scatter_mode="RT"),
    "smooth varnish": Layer(Dielectric(roughness=0.0), Diffuse(WHITE)),
    "varnish in a mix": Mix(Layer(Dielectric(roughness=0.0), Diffuse(WHITE)), Diffuse(WHITE), 0.3),
    "clear preview surface": PreviewSurface(roughness=0.0, opacity=0.0),
    "mirror over anything": Layer(WHITE_MIRROR, Diffuse(WHITE)),
}

# All that is white in them is white; what they lose is GGX's missing second bounce, and light that
# would go back and forth between layers.
LOSSY = {
    "rough dielectric": Dielectric(roughness=0.4, scatter_mode="RT"),
    "rough Schlick": GeneralizedSchlick(WHITE, roughness=0.7),
    "rough metal": Conductor(roughness=0.5),
    "nearly smooth": Dielectric(roughness=2e-3, scatter_mode="RT"),
    "plastic": Layer(Dielectric(roughness=0.3), Diffuse(WHITE)),
    "anisotropic plastic": Layer(Dielectric(roughness=(0.1, 0.6)), Diffuse(WHITE)),
    "coat on coat": Layer(
        GeneralizedSchlick((0.2, 0.1, 0.04), roughness=0.2),
        Layer(Dielectric(ior=1.8, roughness=0.05), Diffuse(WHITE)),
    ),
    "layer of a layer": Layer(
        Mix(Layer(Dielectric(roughness=0.3), Diffuse(WHITE)), WHITE_MIRROR, 0.3), Diffuse(WHITE)
    ),
    "layers in mixes": Mix(
        Layer(Dielectric(roughness=0.5), Diffuse(WHITE)),
        Layer(Dielectric(roughness=0.01), Conductor(roughness=0.2)),
        0.5,
    ),
    "metal under a coat": Layer(Dielectric(roughness=0.4), Conductor(roughness=0.3)),
    "glass in parts": Layer(Dielectric(roughness=0.3), Dielectric(roughness=0.1, scatter_mode="T")),
    "velvet": Layer(Sheen(roughness=0.3), Diffuse(WHITE)),
    "velvet of short fibres": Layer(Sheen(roughness=0.05), Diffuse(WHITE)),
    "lacquered velvet": Layer(
        Dielectric(roughness=0.3), Layer(Sheen(roughness=0.5), Diffuse(WHITE, 1.0, 0.5, True))
    ),
    "metal with an edge": GeneralizedSchlick(WHITE, color82=(1.0, 0.5, 0.0), roughness=0.3),
    "clear coat over a mix of other indices": Layer(
        Dielectric(ior=1.6, roughness=0.0),
        Mix(
            Dielectric(ior=1.28, roughness=0.0, scatter_mode="RT"),
            Layer(Dielectric(ior=1.28, roughness=0.0), Diffuse(WHITE)),
            0.3,
        ),
    ),
    "preview surface": PreviewSurface(WHITE, clearcoat=1.0, clearcoatRoughness=0.3),
    "metallic preview surface": PreviewSurface(WHITE, metallic=1.0, roughness=0.3),
    "half clear preview surface": PreviewSurface(WHITE, roughness=0.3, opacity=0.5),
    "clear preview surface": PreviewSurface(WHITE, roughness=0.5, clearcoat=0.5, opacity=0.0),
}


def energy(closure, cosine: float) -> tuple[np.ndarray, np.ndarray]:
    """Share of light from a direction that is scattered, and its standard error, (3,) each."""
    carried = draw(closure, polar(cosine, 0.4), "light", SAMPLES).throughput()
    return carried.mean(axis=0), carried.std(axis=0) / np.sqrt(SAMPLES)


@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_closures_scatter_all_light(name):
    """Catches any lost or doubled factor: Fresnel terms, Dirac cosines, layer normalisation."""
    closure = probe(LOSSLESS[name])
    for cosine in COSINES:
        share, error = energy(closure, cosine)
        assert (np.abs(share - 1) < 4.5 * error + 2e-3).all(), (cosine, share)


@pytest.mark.parametrize("name", LOSSY)
def test_no_closure_scatters_more_than_it_receives(name):
    """Catches layers that count the light twice, and tables that are too low by 2 %."""
    closure = probe(LOSSY[name])
    for cosine in COSINES:
        share, error = energy(closure, cosine)
        assert (share < 1.02 + 4.5 * error).all(), (cosine, share)
        assert (share > 0.1).all(), (cosine, share)


@pytest.mark.parametrize(
    "name", ["rough dielectric", "nearly smooth", "half clear preview surface"]
)
def test_radiance_in_a_furnace_is_that_of_the_medium(name):
    """From the eye: ∫ f L cosθ with L = η² on each side gives η_e² times the share of energy."""
    closure = probe(LOSSY[name])
    for cosine in COSINES:
        eye = polar(cosine, 0.4)
        s = draw(closure, eye, "eye", SAMPLES)
        eta = next(x["eta"] for x in closure.lobes if x["transmits"])
        of_light = np.where(s.directions[:, 2] > 0, 1.0, eta**2)
        radiance = s.throughput() * of_light[:, None] / (1.0 if cosine > 0 else eta**2)
        share, error = energy(closure, cosine)
        both = np.hypot(error, radiance.std(axis=0) / np.sqrt(SAMPLES))
        assert (np.abs(radiance.mean(axis=0) - share) < 4.5 * both + 1e-4).all()


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("f0", [0.04, 0.5])
def test_a_rough_layer_over_white_loses_nothing(alpha, f0):
    """E(ω) + T(ω): the tables of E against the quadrature of f, at every roughness."""
    layered = probe(Layer(GeneralizedSchlick((f0,) * 3, roughness=alpha), Diffuse(WHITE)))
    for cosine in (0.98, 0.7, 0.4, 0.15):
        assert albedo(layered, polar(cosine), "eye") == pytest.approx(1.0, abs=6e-3)


def test_a_white_rough_mirror_loses_what_single_scattering_loses():
    """At normal incidence and alpha 1: Λ = 0 there, so E = ∫ D h_z G1(l) dω_h, l the mirror of h.

    D h_z dω_h is uniform in sin²θ_h, and l_z = 2 cos²θ_h − 1. Catches separable masking, a
    missing mirror direction below the horizon, a wrong normalisation of D.
    """
    l_z = 1 - 2 * (np.arange(100_000) + 0.5) / 100_000
    g1 = 2 / (1 + np.sqrt(1 + (1 - l_z**2) / l_z**2))
    expected = np.where(l_z > 0, g1, 0.0).mean()
    share = albedo(probe(GeneralizedSchlick(WHITE, roughness=1.0)), polar(1.0), "eye")
    assert share == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("roughness", [0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0])
def test_sheen_alone_reflects_less_than_it_receives_and_most_at_grazing_angles(roughness):
    """Catches a missing normalisation: the published lobe's albedo is 3.9 at roughness 0.01."""
    closure = probe(Sheen(WHITE, roughness=roughness))
    shares = [albedo(closure, polar(c), "eye")[0] for c in (0.01, 0.03, 0.1, 0.3, 0.7, 1.0)]
    assert max(shares) <= 1.001
    assert shares == sorted(shares, reverse=True)
    # The limit of the albedo at grazing angles, in closed form.
    p = 1 / max(roughness, 0.01)
    limit = (2 + p) / (2 * np.sqrt(np.pi)) * np.exp(gammaln((p + 3) / 2) - gammaln(p / 2 + 2))
    if roughness >= 0.2:  # below it, the peak is too narrow for this quadrature
        assert shares[0] == pytest.approx(min(limit, 1), rel=0.08)


@pytest.mark.parametrize("roughness", [0.02, 0.05, 0.1, 0.2, 0.5, 1.0])
def test_sheen_over_white_loses_nothing(roughness):
    """The table of its albedo against the quadrature of its values."""
    layered = probe(Layer(Sheen(WHITE, roughness=roughness), Diffuse(WHITE)))
    for cosine in (0.98, 0.7, 0.4, 0.15):
        assert albedo(layered, polar(cosine), "eye") == pytest.approx(1.0, abs=6e-3)


def test_an_edge_tint_is_the_reflectance_at_82_degrees():
    """color82 scales what Schlick's curve has at cosθ = 1/7, and leaves both ends as they are."""
    metal = GeneralizedSchlick((0.9, 0.6, 0.3), roughness=0.0, color82=(0.8, 0.5, 0.2), weight=1.0)
    plain = GeneralizedSchlick((0.9, 0.6, 0.3), roughness=0.0)
    for cosine, tint in ((1.0, (1, 1, 1)), (1 / 7, (0.8, 0.5, 0.2)), (1e-4, (1, 1, 1))):
        shares = [energy(probe(closure), cosine)[0] for closure in (metal, plain)]
        np.testing.assert_allclose(shares[0], shares[1] * tint, rtol=1e-3)


def test_oren_nayar_gains_at_most_what_the_model_gains():
    """The qualitative model exceeds 1 at grazing angles, by A + B/2 − 1 ≤ 0.0153."""
    sigma = 0.2
    closure = probe(Diffuse(WHITE, roughness=sigma))
    a = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    assert albedo(closure, polar(1e-3), "eye") == pytest.approx(a + b / 2, abs=2e-3)
    for cosine in COSINES:
        assert (albedo(closure, polar(cosine), "eye") < 1.0153).all()
