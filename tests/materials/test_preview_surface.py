"""UsdPreviewSurface: reflectances, workflows, coat, opacity, after the specification's formulas.

r = (1 − ior) / (1 + ior). Metallic workflow: s = lerp(1, diffuseColor, metallic),
F0 = lerp(r² s, s, metallic), F90 = s, diffuse × (1 − metallic). Specular workflow:
F0 = specularColor, F90 = 1. Coat: F0 = r², F90 = 1. GGX of alpha = roughness².
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import (
    albedo,
    delta_transmission,
    draw,
    mirrored,
    polar,
    probe,
    refracted,
    rows,
)
from usdmlt.scene import PreviewSurface

COLOR = np.array([0.8, 0.4, 0.1])


def lobes(**inputs: object) -> dict[str, dict]:
    """The lobes by part: coat, specular, diffuse, refraction."""
    found = {}
    for lobe in probe(PreviewSurface(diffuseColor=tuple(COLOR), **inputs)).lobes:
        if lobe["type"] == "diffuse":
            part = "diffuse"
        elif lobe["transmits"]:
            part = "refraction"
        else:
            part = "specular" if "clearcoat" not in inputs or "coat" in found else "coat"
        found[part] = lobe
    return found


@pytest.mark.parametrize("ior", [1.5, 1.33, 2.4, 1.0, 0.8])
@pytest.mark.parametrize("metallic", [0.0, 0.3, 1.0])
def test_metallic_workflow(ior, metallic):
    r2 = ((1 - ior) / (1 + ior)) ** 2
    s = (1 - metallic) + metallic * COLOR
    found = lobes(ior=ior, metallic=metallic)
    assert_allclose(found["specular"]["color0"], (1 - metallic) * r2 * s + metallic * s, rtol=1e-5)
    assert_allclose(found["specular"]["color90"], s, rtol=1e-5)
    assert_allclose(found["specular"]["weight"], 1)
    assert found["specular"]["exponent"] == 5
    if metallic < 1:
        assert_allclose(found["diffuse"]["weight"], COLOR * (1 - metallic), rtol=1e-5)
    else:
        assert "diffuse" not in found


def test_specular_workflow_ignores_metallic():
    specular = (0.3, 0.2, 0.1)
    found = lobes(useSpecularWorkflow=1, specularColor=specular, metallic=0.7)
    assert_allclose(found["specular"]["color0"], specular)
    assert_allclose(found["specular"]["color90"], 1)
    assert_allclose(found["diffuse"]["weight"], COLOR)


@pytest.mark.parametrize(("roughness", "smooth"), [(0.0, True), (0.01, True), (0.05, False)])
def test_alpha_is_roughness_squared(roughness, smooth):
    found = lobes(roughness=roughness, clearcoat=1.0, clearcoatRoughness=2 * roughness)
    assert found["specular"]["delta"] == smooth
    if not smooth:
        assert_allclose(found["specular"]["alpha"], roughness**2)
        assert_allclose(found["coat"]["alpha"], 4 * roughness**2)


def test_the_coat_is_white_and_of_the_same_index():
    found = lobes(ior=1.8, clearcoat=0.6, metallic=1.0)
    assert_allclose(found["coat"]["color0"], (0.8 / 2.8) ** 2, rtol=1e-5)
    assert_allclose(found["coat"]["color90"], 1)
    assert_allclose(found["coat"]["weight"], 0.6)


def test_the_coat_attenuates_what_is_below():
    """base × (1 − clearcoat · F) at the mirror direction of smooth layers."""
    inputs = {"metallic": 1.0, "roughness": 0.0, "clearcoatRoughness": 0.0}
    known = polar(0.2)
    pair = known[None], mirrored(known)[None]
    bare = probe(PreviewSurface(tuple(COLOR), **inputs)).evaluate(*pair, component=1)
    coated = probe(PreviewSurface(tuple(COLOR), clearcoat=0.6, **inputs))
    coat, base = (coated.evaluate(*pair, component=c) for c in (1, 3))
    fresnel = 0.04 + 0.96 * 0.8**5
    assert_allclose(coat, 0.6 * fresnel, rtol=1e-4)
    assert_allclose(base, bare * (1 - 0.6 * fresnel), rtol=1e-4)


def test_specular_reflection_takes_from_the_diffuse_part():
    surface = probe(PreviewSurface((1.0, 1.0, 1.0), roughness=0.4))
    for cosine in (0.9, 0.3):
        assert_allclose(albedo(surface, polar(cosine), "eye"), 1.0, atol=6e-3)


def test_opacity_dims_the_diffuse_part_and_opens_the_rest():
    found = lobes(opacity=0.3, metallic=0.5)
    assert_allclose(found["diffuse"]["weight"], COLOR * 0.5 * 0.3, rtol=1e-5)
    assert_allclose(found["refraction"]["weight"], 0.5 * 0.7, rtol=1e-5)
    assert found["refraction"]["delta"]
    assert found["refraction"]["eta"] == pytest.approx(1.5)
    assert_allclose(found["specular"]["weight"], 1)
    assert "refraction" not in lobes(opacity=1.0)
    assert "refraction" not in lobes(opacity=0.3, metallic=1.0)
    assert "diffuse" not in lobes(opacity=0.0)


@pytest.mark.parametrize("cosine", [0.9, 0.3, 0.05, -0.9, -0.8])
def test_clear_smooth_surfaces_reflect_f_and_refract_the_rest(cosine):
    """Schlick's F of the outer angle, from both sides, once: not again by the refracting lobe."""
    surface = probe(PreviewSurface(roughness=0.0, opacity=0.0))
    known = polar(cosine)
    other = refracted(known, 1.5)
    outer = max(known[2], other[2])
    fresnel = 0.04 + 0.96 * (1 - outer) ** 5
    n = 20_000
    s = draw(surface, known, "light", n)
    across = s.components == delta_transmission(1)
    assert_allclose(s.directions[across], rows(other, across.sum()), atol=1e-6)
    share = s.throughput()[:, 0]
    assert share[across].sum() / n == pytest.approx(1 - fresnel, abs=0.02)
    assert share[~across].sum() / n == pytest.approx(fresnel, abs=0.02)
    assert_allclose(share, 1.0, rtol=1e-3)


def test_clear_smooth_surfaces_reflect_totally_from_inside():
    s = draw(probe(PreviewSurface(roughness=0.0, opacity=0.0)), polar(-0.5), "eye", 100)
    assert (s.directions[:, 2] < 0).all()
    assert_allclose(s.throughput(), 1.0, rtol=1e-5)


@pytest.mark.parametrize("cosine", [1.0, 0.6, -0.6])
def test_index_one_lets_light_pass_straight_on(cosine):
    surface = probe(PreviewSurface(ior=1.0, opacity=0.0, roughness=0.0))
    known = polar(cosine)
    s = draw(surface, known, "eye", 2000)
    across = s.directions[:, 2] * cosine < 0
    assert across.mean() > 0.98
    assert_allclose(s.directions[across], rows(-known, across.sum()), atol=1e-6)
    assert_allclose(s.throughput()[across], 1.0, rtol=1e-4)


@pytest.mark.parametrize("ior", [0.0, -2.0, float("nan")])
def test_an_index_that_is_none_is_the_default(ior):
    assert lobes(ior=ior, clearcoat=0.5) == lobes(ior=1.5, clearcoat=0.5)


def test_emission_is_added_unchanged():
    surface = probe(PreviewSurface(emissiveColor=(3.0, 2.0, 1.0), clearcoat=1.0, opacity=0.2))
    assert_allclose(surface.emission, (3.0, 2.0, 1.0))
    assert_allclose(surface.emission_alone, (3.0, 2.0, 1.0))
