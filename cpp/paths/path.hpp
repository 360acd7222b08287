// A whole path, its contribution, and the density of every way to make it.
//
// Area-product measure throughout (Veach 1997, ch. 8 and 10); directions at infinity count in solid
// angle, Dirac components in the unit of closure.hpp, which cancels in every ratio.
#pragma once

#include <vector>

#include "paths/subpath.hpp"

namespace usdmlt {

// x0 … xk. The vertices belong to whoever made them; component[i] tells how x_i scatters in this
// path, edge[i] is the transmittance between x_{i−1} and x_i.
struct Path {
    std::vector<const Vertex*> vertices;
    std::vector<Component> component;
    std::vector<float> edge;

    int edges() const { return static_cast<int>(vertices.size()) - 1; }
    const Vertex& operator[](int i) const { return *vertices[static_cast<size_t>(i)]; }
};

// Joins s vertices of a light subpath and t of a camera subpath by an edge of transmittance `edge`
// (s = 0: the camera subpath itself). The joined vertices scatter by their non-Dirac component.
// The lens of t = 1 and the light point of s = 1 may stand alone: first vertices of their subpaths.
Path join_subpaths(const Subpath& light, int s, const Subpath& camera, int t, float edge);

// A spectrum in double: contributions of long paths leave the range of float.
struct Contribution {
    double c[3] = {0, 0, 0};
};

// f(x) = Le α0 · ∏ G τ · ∏ f_s |cosθ_s/cosθ_g| α · We: opacity α of every surface, transmittance τ
// of every edge.
Contribution contribution(const Scene& scene, const Path& path);

// Whether strategy s can make the path: both ends of the join scatter by a non-Dirac component.
bool has_strategy(const Path& path, int s);

// p_{s,t}(x), t = k + 1 − s, without roulette; x0 by direct sampling for s = 1.
double strategy_density(const Scene& scene, const Path& path, int s);

// w_s = p_s² / Σ_j p_j². The definition; strategy_weight (connect.hpp) is the same number in O(1).
double power_heuristic(const Scene& scene, const Path& path, int s);

}  // namespace usdmlt
