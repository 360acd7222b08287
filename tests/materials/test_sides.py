"""Which side of a surface a direction is on: shading against geometric normal, above and below."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import draw, polar, probe, random_directions, rows
from usdmlt.scene import (
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Layer,
    PreviewSurface,
    Translucent,
)

TILTED = (0.6, 0.0, 0.8)  # the shading normal; the geometric one is +z
PLASTIC = Layer(Dielectric(roughness=0.2), Diffuse())
CLOSURES = {
    "lambert": Diffuse(),
    "oren_nayar": Diffuse(roughness=0.4),
    "translucent": Translucent(),
    "rough glass": Dielectric(roughness=0.5, scatter_mode="RT"),
    "plastic": PLASTIC,
}


@pytest.mark.parametrize("name", CLOSURES)
def test_nothing_is_scattered_where_the_normals_disagree_about_the_side(name):
    """Catches light that leaks through the surface, and values that densities do not know."""
    closure = probe(CLOSURES[name], shading_normal=TILTED)
    light, eye = random_directions(4000, seed=1), random_directions(4000, seed=2)
    agree = ((light @ TILTED) * light[:, 2] > 0) & ((eye @ TILTED) * eye[:, 2] > 0)
    value = closure.evaluate(light, eye)
    assert (value[~agree] == 0).all()
    assert (value[agree] > 0).any()
    for role in ("eye", "light"):
        assert (closure.pdf(eye, light, role)[~agree] == 0).all()


@pytest.mark.parametrize("name", CLOSURES)
def test_samples_to_the_wrong_side_are_rejected(name):
    closure = probe(CLOSURES[name], shading_normal=TILTED)
    known = np.array([0.3, 0.2, 0.933])
    s = draw(closure, known / np.linalg.norm(known), "eye", 4000)
    assert 0 < s.valid.sum() < 4000
    w = s.directions[s.valid]
    assert ((w @ TILTED) * w[:, 2] > 0).all()
    # The density still integrates to the chance of success, about one in ten is lost.
    between = np.array([-0.95, 0.0, 0.31])  # above the surface, below the shading plane
    assert not draw(closure, between / np.linalg.norm(between), "eye", 100).valid.any()


def test_dirac_samples_to_the_wrong_side_are_rejected():
    mirror = probe(GeneralizedSchlick(roughness=0.0), shading_normal=TILTED)
    known = np.array([-0.6, 0.0, 0.8])  # its mirror direction is below the surface
    assert not draw(mirror, known, "eye", 10).valid.any()
    assert draw(mirror, np.array([0.0, 0.0, 1.0]), "eye", 10).valid.all()


TWO_SIDED = {
    "lambert": Diffuse((0.7, 0.5, 0.3)),
    "oren_nayar": Diffuse(roughness=0.4),
    "translucent": Translucent(),
    "metal": Conductor(roughness=0.3),
    "schlick": GeneralizedSchlick((0.5, 0.3, 0.1), roughness=0.3),
    "dielectric": Dielectric(roughness=0.3),
    "plastic": PLASTIC,
    "preview surface": PreviewSurface(clearcoat=0.5),
}


@pytest.mark.parametrize("name", TWO_SIDED)
def test_what_bounds_no_medium_looks_the_same_from_below(name):
    closure = probe(TWO_SIDED[name])
    light, eye = random_directions(1000, seed=1), random_directions(1000, seed=2)
    flip = np.array([1.0, 1.0, -1.0])
    assert_allclose(closure.evaluate(light, eye), closure.evaluate(light * flip, eye * flip))
    assert_allclose(
        closure.pdf(eye, light, "eye"), closure.pdf(eye * flip, light * flip, "eye"), rtol=1e-6
    )


def test_a_reflecting_layer_sees_the_inside_where_the_base_refracts():
    """The same lobe alone is two-sided; over a refracting base it reflects totally from inside."""
    alone = probe(Dielectric(roughness=0.0))
    layered = probe(Layer(Dielectric(roughness=0.0), Dielectric(roughness=0.0, scatter_mode="T")))
    inside = polar(-0.3)
    assert draw(alone, inside, "eye", 1).throughput()[0, 0] < 0.3
    assert_allclose(draw(layered, inside, "eye", 100).throughput(), 1.0, rtol=1e-5)


def test_directions_in_the_tangent_plane_scatter_nothing():
    horizon = rows([1.0, 0.0, 0.0], 3)
    above = rows([0.0, 0.6, 0.8], 3)
    for closure in map(probe, (*CLOSURES.values(), *TWO_SIDED.values())):
        assert (closure.evaluate(horizon, above) == 0).all()
        assert (closure.evaluate(above, horizon) == 0).all()
        assert (closure.pdf(above, horizon, "eye") == 0).all()
        assert not draw(closure, horizon[0], "eye", 20).valid.any()
