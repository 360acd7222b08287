"""Values of GGX lobes against the published formulas, written down again in double precision.

Walter et al. 2007 (eq. 20, 21, 33), anisotropic as in Heitz 2014 (eq. 85, 86), height-correlated
Smith masking (eq. 99). The χ² and furnace tests cannot see an error that value and density share;
these can.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import draw, polar, probe, random_directions
from usdmlt.scene import Conductor, Dielectric, Diffuse, GeneralizedSchlick, Translucent


def distribution(h, ax, ay):
    """D of the normals h."""
    tan2 = (h[:, 0] / ax) ** 2 + (h[:, 1] / ay) ** 2
    return 1 / (np.pi * ax * ay * h[:, 2] ** 4 * (1 + tan2 / h[:, 2] ** 2) ** 2)


def smith_lambda(w, ax, ay):
    """Λ of directions."""
    a2 = ((ax * w[:, 0]) ** 2 + (ay * w[:, 1]) ** 2) / w[:, 2] ** 2
    return (np.sqrt(1 + a2) - 1) / 2


def dielectric(c, m):
    """Fresnel reflectance, 1 beyond the critical angle."""
    t = np.sqrt(np.maximum(0, 1 - (1 - c**2) / m**2))
    return (((c - m * t) / (c + m * t)) ** 2 + ((m * c - t) / (m * c + t)) ** 2) / 2


def dot(a, b):
    """Row by row."""
    return (a * b).sum(axis=1)


def ggx_reflection(light, eye, ax, ay, fresnel):
    """F D G / (4 |l_z e_z|); 0 across the surface."""
    h = light + eye
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    g = 1 / (1 + smith_lambda(light, ax, ay) + smith_lambda(eye, ax, ay))
    f = (
        fresnel(np.abs(dot(light, h)))
        * distribution(h, ax, ay)
        * g
        / (4 * np.abs(light[:, 2] * eye[:, 2]))
    )
    return np.where(light[:, 2] * eye[:, 2] > 0, f, 0.0)


def ggx_refraction(light, eye, ax, ay, eta):
    """Walter's eq. 21, light from l; 0 on one side of the surface."""
    eta_l, eta_e = (np.where(w[:, 2] > 0, 1.0, eta) for w in (light, eye))
    h = -(eta_l[:, None] * light + eta_e[:, None] * eye)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    h *= np.sign(h[:, 2:])
    l_h, e_h = dot(light, h), dot(eye, h)
    g = 1 / (1 + smith_lambda(light, ax, ay) + smith_lambda(eye, ax, ay))
    reflectance = dielectric(np.abs(l_h), eta_e / eta_l)
    f = (
        np.abs(l_h * e_h / (light[:, 2] * eye[:, 2]))
        * (eta_e**2 * (1 - reflectance) * g * distribution(h, ax, ay))
        / (eta_l * l_h + eta_e * e_h) ** 2
    )
    front = (l_h * light[:, 2] > 0) & (e_h * eye[:, 2] > 0) & (light[:, 2] * eye[:, 2] < 0)
    return np.where(front, f, 0.0)


@pytest.fixture(scope="module")
def pairs():
    """Random directions to the light and to the eye."""
    return random_directions(5000, seed=5), random_directions(5000, seed=6)


@pytest.mark.parametrize("alphas", [(1.0, 1.0), (0.3, 0.3), (0.6, 0.15), (0.05, 0.05)])
def test_rough_dielectrics_have_walters_values(pairs, alphas):
    light, eye = pairs
    eta = 1.4
    f = probe(Dielectric(ior=eta, roughness=alphas, scatter_mode="RT"), tangent=(1, 0, 0))
    m = np.where(eye[:, 2] > 0, eta, 1 / eta)
    expected = ggx_reflection(light, eye, *alphas, lambda c: dielectric(c, m))
    expected += ggx_refraction(light, eye, *alphas, eta)
    assert (expected > 0).mean() > 0.5
    assert_allclose(f.evaluate(light, eye)[:, 1], expected, rtol=2e-3, atol=1e-6)


def test_nearly_smooth_lobes_have_the_formulas_values_at_their_peak():
    """alpha 1e-3: what float makes of half vectors 1e-3 wide."""
    alpha = 1e-3
    closure = probe(Dielectric(roughness=alpha, scatter_mode="RT"))
    for cosine in (0.9, 0.2, -0.9):
        known = polar(cosine)
        s = draw(closure, known, "eye", 4000)
        light, eye = s.directions[s.valid], np.tile(known, (s.valid.sum(), 1))
        m = 1.5 if cosine > 0 else 1 / 1.5
        expected = ggx_reflection(light, eye, alpha, alpha, lambda c, m=m: dielectric(c, m))
        expected += ggx_refraction(light, eye, alpha, alpha, 1.5)
        assert np.median(np.abs(closure.evaluate(light, eye)[:, 0] / expected - 1)) < 5e-3


def test_rough_metals_have_the_formulas_values(pairs):
    light, eye = pairs
    eta, k = np.array([0.2, 0.9, 1.4]), np.array([3.9, 2.4, 1.6])

    def fresnel(c, i):
        n = eta[i] + 1j * k[i]
        t = np.sqrt(1 - (1 - c**2) / n**2)
        s, p = (c - n * t) / (c + n * t), (n * c - t) / (n * c + t)
        return (np.abs(s) ** 2 + np.abs(p) ** 2) / 2

    values = probe(Conductor(tuple(eta), tuple(k), roughness=0.4)).evaluate(light, eye)
    for i in range(3):
        expected = ggx_reflection(light, eye, 0.4, 0.4, lambda c, i=i: fresnel(c, i))
        assert_allclose(values[:, i], expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("exponent", [5.0, 2.5])
def test_schlick_lobes_have_the_formulas_values(pairs, exponent):
    light, eye = pairs
    f0, f90 = np.array([0.9, 0.3, 0.04]), np.array([1.0, 0.8, 0.5])
    closure = probe(GeneralizedSchlick(tuple(f0), tuple(f90), exponent, 0.3))
    for i in range(3):
        expected = ggx_reflection(
            *(light, eye, 0.3, 0.3),
            lambda c, i=i: f0[i] + (f90[i] - f0[i]) * (1 - c) ** exponent,
        )
        assert_allclose(closure.evaluate(light, eye)[:, i], expected, rtol=2e-3, atol=1e-6)


def test_schlick_lobes_that_transmit_see_the_refracted_angle_from_inside():
    """The same reflectance from both sides of one path, and color90 under total reflection."""
    f0 = 0.04
    closure = probe(GeneralizedSchlick((f0,) * 3, roughness=0.0, scatter_mode="RT"))
    eta = (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    assert closure.lobes[0]["eta"] == pytest.approx(eta, rel=1e-5)
    for inside in (-0.95, -0.8, -0.5):
        cosine2 = 1 - (1 - inside**2) * eta**2
        expected = f0 + (1 - f0) * (1 - np.sqrt(max(cosine2, 0))) ** 5
        reflected = draw(closure, polar(inside), "light", 20_000).components == 1
        error = np.sqrt(max(expected * (1 - expected), 1e-9) / 20_000)
        assert abs(reflected.mean() - expected) < 4.5 * error + 1e-6


def test_diffuse_lobes_have_the_formulas_values(pairs):
    light, eye = pairs
    same = (light[:, 2] * eye[:, 2] > 0)[:, None]
    color = np.array([0.9, 0.5, 0.1])
    lambert = probe(Diffuse(tuple(color))).evaluate(light, eye)
    assert_allclose(lambert, np.where(same, color / np.pi, 0.0), rtol=1e-6)
    translucent = probe(Translucent(tuple(color))).evaluate(light, eye)
    assert_allclose(translucent, np.where(same, 0.0, color / np.pi), rtol=1e-6)

    # Oren and Nayar's angles: α the larger, β the smaller polar angle.
    sigma2 = 0.6**2
    theta = np.arccos(np.abs(np.stack([light[:, 2], eye[:, 2]])))
    azimuth = np.arctan2(light[:, 1], light[:, 0]) - np.arctan2(eye[:, 1], eye[:, 0])
    a, b = 1 - 0.5 * sigma2 / (sigma2 + 0.33), 0.45 * sigma2 / (sigma2 + 0.09)
    rough = a + b * np.maximum(0, np.cos(azimuth)) * np.sin(theta.max(0)) * np.tan(theta.min(0))
    values = probe(Diffuse(tuple(color), roughness=0.6)).evaluate(light, eye)
    assert_allclose(values, np.where(same, color / np.pi * rough[:, None], 0.0), rtol=1e-4)
