"""f(l, e) / η_e² = f(e, l) / η_l² for every closure, rough and smooth.

Catches: radiance scaled for the wrong role or not at all, layers that attenuate one direction more
than the other, half vectors and Fresnel terms of one side only.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import (
    NON_DELTA,
    delta_reflection,
    delta_transmission,
    draw,
    mirrored,
    probe,
    random_directions,
    refracted,
)
from usdmlt.scene import Dielectric


def eta_squared(closure, w: np.ndarray) -> np.ndarray:
    """Squared relative index on the side of each direction, of the rough lobes that refract."""
    eta = next((x["eta"] for x in closure.lobes if x["transmits"]), 1.0)
    return np.where(w[:, 2] > 0, 1.0, eta**2)


def test_values_of_random_pairs_are_reciprocal(any_closure):
    light, eye = random_directions(4000, seed=1), random_directions(4000, seed=2)
    forth = any_closure.evaluate(light, eye) / eta_squared(any_closure, eye)[:, None]
    back = any_closure.evaluate(eye, light) / eta_squared(any_closure, light)[:, None]
    assert any_closure.has_non_delta == bool((forth > 0).any())
    assert_allclose(forth, back, rtol=1e-4, atol=1e-7)


def test_values_of_sampled_pairs_are_reciprocal(rough, known):
    """Where the value is: random pairs miss the peak of a narrow lobe."""
    s = draw(rough, known, "eye", 2000)
    eye = np.tile(known, (s.valid.sum(), 1))
    light = s.directions[s.valid]
    forth = rough.evaluate(light, eye) / eta_squared(rough, eye)[:, None]
    back = rough.evaluate(eye, light) / eta_squared(rough, light)[:, None]
    assert (forth > 0).any(axis=1).mean() > 0.99
    # Half vectors in float, seen through alpha 1e-3.
    assert_allclose(forth, back, rtol=1e-2, atol=1e-7)


@pytest.mark.parametrize("cosine", [0.95, 0.4, 0.06])
def test_dirac_values_are_reciprocal(smooth, cosine):
    """The stored coefficient of a refraction is T η_eye²: the same T from both sides."""
    above = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    for i, lobe in enumerate(smooth.lobes):
        if not lobe["delta"]:
            continue
        pairs = []
        if lobe["reflects"]:
            pairs.append((delta_reflection(i), mirrored(above)))
        below = refracted(above, lobe["eta"]) if lobe["transmits"] else None
        if below is not None:
            pairs.append((delta_transmission(i), below))
        for component, other in pairs:
            a, b = above[None], other[None]
            eta_a, eta_b = (smooth.eta_of_side(w, component)[0] for w in (a, b))
            # A dielectric of index 1 reflects nothing.
            nothing = lobe["type"] == "dielectric" and lobe["eta"] == 1 and other[2] > 0
            forth = smooth.evaluate(a, b, component) / eta_b**2
            back = smooth.evaluate(b, a, component) / eta_a**2
            assert (forth > 0).any() != nothing
            assert_allclose(forth, back, rtol=1e-4)


def test_dirac_densities_are_the_same_discrete_probability_for_a_single_lobe_from_both_sides():
    """pdf = P |cosθ_sampled| η_sampled², so P follows from the density, forward and backward."""
    glass = probe(Dielectric(roughness=0.0, scatter_mode="RT"))
    above = np.array([[0.6, 0.0, 0.8]])
    for component, other in (
        (delta_reflection(0), mirrored(above[0])[None]),
        (delta_transmission(0), refracted(above[0], 1.5)[None]),
    ):
        eta = glass.eta_of_side(other, component)
        p_forth = glass.pdf(above, other, "eye", component) / (np.abs(other[:, 2]) * eta**2)
        p_back = glass.pdf(other, above, "light", component) / above[:, 2]
        assert_allclose(p_forth, p_back, rtol=1e-5)


def test_dirac_directions_have_no_value_in_the_rest(smooth, known):
    """Dirac lobes are not part of the non-Dirac component, nor of another's."""
    if smooth.has_non_delta:
        return
    w = random_directions(500, seed=3)
    fixed = np.tile(known, (500, 1))
    assert (smooth.evaluate(w, fixed, NON_DELTA) == 0).all()
    assert (smooth.pdf(fixed, w, "eye", NON_DELTA) == 0).all()
