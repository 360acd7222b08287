"""Samplers, their densities and the values that come with them, for every lobe and combination.

The χ² tests see: a wrong density (lobe probabilities, Jacobians, normalisation of the microfacets),
a sampler that favours a direction or a side, a tangent frame that is turned, densities that do not
tell what is lost. They could miss deviations below about a percent of a lobe's probability.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import albedo, draw, fit_of_samples, grids_for, probe, rows
from usdmlt.scene import Conductor

SAMPLES = 40_000
# All χ² tests together fail by chance with this probability (Šidák's correction).
SIGNIFICANCE = 1e-3
TESTS = 200
THRESHOLD = -np.expm1(np.log1p(-SIGNIFICANCE) / TESTS)


def test_samples_follow_the_density_which_integrates_to_the_chance_of_success(rough, known):
    for grid, across in grids_for(rough, known):
        fit = fit_of_samples(rough, known, grid, across, SAMPLES)
        assert fit.p_value > THRESHOLD
        error = np.sqrt(max(fit.success * (1 - fit.success), 1e-5) / fit.n)
        assert abs(fit.integral - fit.success) < 4.5 * error + 2e-3


@pytest.mark.parametrize("name", ["frosted_and_clear", "varnish", "tinted_preview_surface"])
def test_samples_beside_dirac_lobes_follow_the_density(name, smooth_closures, known):
    closure = smooth_closures[name]
    for grid, across in grids_for(closure, known):
        assert fit_of_samples(closure, known, grid, across, SAMPLES).p_value > THRESHOLD


def test_samples_do_not_depend_on_the_role(any_closure, known):
    from_eye, from_light = (draw(any_closure, known, role, 2000) for role in ("eye", "light"))
    assert (from_eye.valid == from_light.valid).all()
    ok = from_eye.valid
    assert (from_eye.directions[ok] == from_light.directions[ok]).all()
    assert (from_eye.components[ok] == from_light.components[ok]).all()
    assert_allclose(from_eye.pdfs[ok], from_light.pdfs[ok], rtol=1e-6)


def test_a_sample_carries_the_value_and_density_of_its_direction(any_closure, known, role):
    """Catches a value of the wrong role, a density without the lobe's probability."""
    s = draw(any_closure, known, role, 2000)
    for component in np.unique(s.components[s.valid]):
        mine = s.valid & (s.components == component)
        fixed, sampled = rows(known, mine.sum()), s.directions[mine]
        pair = (sampled, fixed) if role == "eye" else (fixed, sampled)
        values = any_closure.evaluate(*pair, component=component)
        densities = any_closure.pdf(fixed, sampled, role, component=component)
        # The directions went to float and back; microfacets of alpha 1e-3 amplify that.
        assert_allclose(s.values[mine], values, rtol=2e-2, atol=1e-6)
        assert_allclose(s.pdfs[mine], densities, rtol=2e-2, atol=1e-6)
        assert np.median(np.abs(s.pdfs[mine] / densities - 1)) < 2e-4


def test_sampling_estimates_the_integral_of_the_values(rough, known, role):
    """value |cosθ| / pdf averages to ∫ f |cosθ| dω: catches values and densities that disagree."""
    throughput = draw(rough, known, role, SAMPLES).throughput()
    error = throughput.std(axis=0) / np.sqrt(SAMPLES)
    exact = albedo(rough, known, role)
    assert (np.abs(throughput.mean(axis=0) - exact) < 4.5 * error + 3e-3 * exact + 1e-4).all()


def test_samples_use_the_whole_random_number_for_a_stratified_choice_of_lobes(smooth_closures):
    """u_lobe is rescaled: equally spaced numbers give every component its share exactly."""
    closure = smooth_closures["tinted_preview_surface"]
    n = 4000
    u_lobe = (np.arange(n) + 0.5) / n
    u = np.full((n, 2), 0.37)
    known = np.array([0.6, 0.0, 0.8])
    _, _, _, components, valid = closure.sample(rows(known, n), "eye", u_lobe, u)
    assert valid.all()
    # Each component is chosen in one contiguous interval of u_lobe.
    order = [components[0], *components[1:][np.diff(components.astype(int)) != 0]]
    assert len(order) == len(set(order)) >= 3


@pytest.mark.parametrize("alphas", [(0.4, 0.08), (0.08, 0.4)])
def test_anisotropic_lobes_follow_the_tangent(alphas):
    """Along the rougher axis reflections spread wider; the tangent says where x is."""
    known = np.array([0.0, 0.0, 1.0])
    tangent = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    s = draw(probe(Conductor(roughness=alphas), tangent=tuple(tangent)), known, "eye", 20_000)
    along = np.abs(s.directions[s.valid] @ tangent)
    across = np.abs(s.directions[s.valid] @ [-tangent[1], tangent[0], 0])
    ratio = np.median(along) / np.median(across)
    assert ratio == pytest.approx(alphas[0] / alphas[1], rel=0.15)
