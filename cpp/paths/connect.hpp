// Joining subpaths, and the weight of each way to make a path.
//
// Multiple importance sampling over all strategies of a path, power heuristic (Veach 1997, §10.2):
//     w_s = p_s² / Σ_j p_j²,
// the neighbours' ratios being p_{s−1}/p_s = p_E(x_{s−1}) / p_L(x_{s−1}): the density of one vertex
// as made from the eye's and from the light's side. The sums over the interior of the two subpaths
// were accumulated while they were traced (strategy_sum); a join changes the densities of two
// vertices on either side, so a weight costs O(1) whatever the path's length.
//
// Strategy s = 1 draws x0 by sample_direct, whose density p_D depends on x1; every ratio that
// crosses s = 1 uses p_D in the place of p_L(x0). Strategies t = 0 (the lens is hit) and
// (s, t) = (1, 1) (light seen directly, by tracing light) are not used.
#pragma once

#include "paths/subpath.hpp"

namespace usdmlt {

// Densities of x0 that the weights need besides the subpaths' own.
struct LightDensities {
    double point = 0;   // sample_point
    double direct = 0;  // sample_direct, seen from x1
};

// Weight of the path whose last light vertex is `x` (before it `x_previous`; null for s < 2) and
// whose last camera vertex is `z` (before it `z_previous`; null for t = 1), joined by `edge`.
// For s = 0, `x` is null and z is the light vertex. `s`, `t` count vertices.
double strategy_weight(const Scene& scene, const SubpathVertex* x, const SubpathVertex* x_previous,
                       int s, const SubpathVertex& z, const SubpathVertex* z_previous, int t,
                       const LightDensities& densities, const Edge& edge);

// The camera subpath ends on a light (s = 0): Le times throughput, unweighted.
Spectrum emitted_contribution(const Scene& scene, const Subpath& camera, int t);

// Densities of a camera subpath's end as x0, seen from the vertex before it.
LightDensities light_densities(const Scene& scene, const SubpathVertex& x0,
                               const SubpathVertex& x1);

// Next-event estimation from a point: makes x0 and its density p_D; false where there is none.
// `Random` is a Sampler or a RandomStream.
template <typename Random>
bool sample_light(const Scene& scene, Random& random, Vec3f from, float time, SubpathVertex& x0,
                  double& pdf_direct) {
    const Vec2f u = random.next_2d();
    const float u_select = scene.lights.has_choice() ? random.next_1d() : 0;
    LightPoint point;
    if (!sample_direct(scene.lights, from, u_select, u, time, point, pdf_direct)) return false;
    light_vertex(scene, point, time, x0);
    x0.throughput = Spectrum(static_cast<float>(1 / pdf_direct));
    return true;
}

// throughput · scattering · G · scattering · throughput, without visibility and weight; zero where
// the join cannot carry light. x may be x0 (x_previous null), z may be the lens (z_previous null).
Spectrum join(const Scene& scene, const SubpathVertex& x, const SubpathVertex* x_previous,
              const SubpathVertex& z, const SubpathVertex* z_previous);

}  // namespace usdmlt
