// A whole path, its contribution, and the density of every way to make it.
//
// Area-product measure throughout (Veach 1997, ch. 8 and 10); directions at infinity count in solid
// angle, Dirac components in the unit of closure.hpp, which cancels in every ratio.
#pragma once

#include <vector>

#include "base/scaled.hpp"
#include "paths/subpath.hpp"

namespace usdmlt {

// A vertex as part of a path, with the edge before it, and their factors of f.
struct PathVertex {
    const Vertex* vertex = nullptr;   // belongs to whoever made it
    Component component = non_delta;  // how the path scatters here
    Edge edge;                        // between x_{i−1} and x_i
    Vec3f direction;                  // unit, from x_{i−1} to x_i
    double geometry = 1;              // G·τ of that edge
    // Le·α at x0, We at xk, between them f_s·|cosθ_s/cosθ_g|·α; times the media's transmittance
    // before it.
    Spectrum scattering;
    double from_light = 0;  // densities with which the vertex is made, see
    double from_eye = 0;    // density_from_…_side
};

// x0 … xk.
struct Path {
    std::vector<PathVertex> vertices;
    Vec2f raster;       // where the lens sees it; for Metropolis light transport
    double direct = 0;  // density of x0 by direct sampling from x1
    float time = 0;     // of all its vertices; see motion.hpp

    int edges() const { return static_cast<int>(vertices.size()) - 1; }
    const Vertex& operator[](int i) const { return *at(i).vertex; }
    const PathVertex& at(int i) const { return vertices[static_cast<size_t>(i)]; }
    PathVertex& at(int i) { return vertices[static_cast<size_t>(i)]; }
    Vec3f to_light(int i) const { return -at(i).direction; }
    Vec3f to_eye(int i) const { return at(i + 1).direction; }
    bool is_delta(int i) const { return at(i).component != non_delta; }
};

// Joins s vertices of a light subpath and t of a camera subpath by an edge
// (s = 0: the camera subpath itself). The joined vertices scatter by their non-Dirac component.
// The lens of t = 1 and the light point of s = 1 may stand alone: first vertices of their subpaths.
void join_subpaths(const Subpath& light, int s, const Subpath& camera, int t, const Edge& edge,
                   Path& path);

// Fill in the factors of edges, and of vertices, first … last. The latter is false where one of
// them is black; those after it are then left as they were.
void update_edges(Path& path, int first, int last);
bool update_scattering(const Scene& scene, Path& path, int first, int last);

// c[i] · 2^exponent: contributions in double, and beyond its range.
struct Contribution {
    double c[3] = {0, 0, 0};
    int64_t exponent = 0;
};

// f(x) = Le α0 · ∏ G τ · ∏ f_s |cosθ_s/cosθ_g| α · We, from the factors that are stored.
Contribution product_of_factors(const Path& path);

// f(x) with all factors made anew.
Contribution contribution(const Scene& scene, Path& path);

// Densities with which x_i is made from its neighbour nearer to the light, and nearer to the eye:
// components and transmittances included, x0 by sample_point.
double density_from_light_side(const Scene& scene, const Path& path, int i);
double density_from_eye_side(const Scene& scene, const Path& path, int i);

// Whether strategy s can make the path: both ends of the join scatter by a non-Dirac component.
bool has_strategy(const Path& path, int s);

// p_{s,t}(x), t = k + 1 − s, without roulette; x0 by direct sampling for s = 1.
ScaledDouble strategy_density(const Scene& scene, const Path& path, int s);

// Fill in the densities that a change of vertices x_first … x_last touches.
void update_densities(const Scene& scene, Path& path, int first, int last);

// Memory for products along paths of up to `edges` edges.
struct DensityScratch {
    std::vector<double> plain;
    std::vector<ScaledDouble> scaled;

    explicit DensityScratch(int edges)
        : plain(static_cast<size_t>(edges) + 3), scaled(static_cast<size_t>(edges) + 3) {}
};

// Σ_s p_s(x)² from the densities that are stored.
ScaledDouble squared_strategy_densities(const Path& path, DensityScratch& scratch);

// w_s = p_s² / Σ_j p_j². The definition; strategy_weight (connect.hpp) is the same number in O(1).
double power_heuristic(const Scene& scene, const Path& path, int s);

}  // namespace usdmlt
