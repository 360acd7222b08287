// Subpaths: random walks from a light or from the camera, with the densities of both directions.
//
// Symbols as in Veach (1997, ch. 10): a path x0 … xk, x0 on a light, xk on the lens; a strategy
// (s, t) makes s vertices from the light and t = k + 1 − s from the camera. For every vertex,
//     pdf_forward   density with which this subpath generated it,
//     pdf_reverse   density with which the other end would have generated it,
// in area measure. Russian roulette is left out of both: the weights that are made of them stay a
// function of the path alone, and sum to one.
#pragma once

#include "base/sampler.hpp"
#include "paths/trace.hpp"

namespace usdmlt {

struct SubpathVertex : Vertex {
    Spectrum throughput;  // of the subpath up to here, before scattering here
    double pdf_forward = 0;
    double pdf_reverse = 0;
    Vec3f to_previous;   // unit direction to the previous vertex
    Edge edge;           // from the previous vertex
    float survival = 1;  // probability that roulette let the walk come here
    // Power-heuristic sum of the strategies that leave this subpath no more than this vertex's
    // index in vertices, relative to the strategy of exactly that many: see connect.hpp.
    double strategy_sum = 0;
};

// Roulette that is the same for all: walks go on from non-Dirac vertices, but for the first few,
// with one probability, so that survival is known from a path's class. Best is the fraction of
// light that goes on, which walks measure as they are.
struct Continuation {
    static constexpr int certain = 1;  // vertices from which all go on
    double probability = 1;
    double arrived = 0, went_on = 0;  // throughput in units of the walk's, summed over vertices
};

// Vertices of one thread: capacity is chosen once, from the depth limit.
struct Subpath {
    std::vector<SubpathVertex> vertices;
    int count = 0;
    double pdf_point = 0;   // light subpaths: density of x0 by sample_point,
    double pdf_direct = 0;  // and by sample_direct seen from x1
    bool roulette = true;   // walks end at random where little light is left; else
    Continuation continuation;
    // Where media emit: what the first `edges_with_glow` edges of a camera subpath bring.
    std::vector<Spectrum> glow;
    int edges_with_glow = 0;
    Vec3f last_direction;

    explicit Subpath(int capacity)
        : vertices(static_cast<size_t>(capacity)), glow(static_cast<size_t>(capacity)) {}
    SubpathVertex& operator[](int i) { return vertices[static_cast<size_t>(i)]; }
    const SubpathVertex& operator[](int i) const { return vertices[static_cast<size_t>(i)]; }
};

// p_(s)/p_(s+1) between neighbouring strategies is squared: the power heuristic, β = 2.
inline double squared_ratio(double a, double b) { return b > 0 ? (a / b) * (a / b) : 0; }

// The time of a new path: uniform over the shutter's interval.
inline float sample_time(const Scene& scene, Sampler& sampler) {
    return scene.has_motion ? sampler.next_1d() : 0;
}

// Camera subpath of at most `max_vertices` vertices through a raster point; the first is the lens.
// An escaping ray ends in a vertex at infinity where there is an environment.
void trace_camera_subpath(const Scene& scene, Sampler& sampler, Vec2f raster, float time,
                          int max_vertices, RayCounters& counters, Subpath& subpath);

// Light subpath of at most `max_vertices` vertices; empty where no light could be sampled.
void trace_light_subpath(const Scene& scene, Sampler& sampler, float time, int max_vertices,
                         RayCounters& counters, Subpath& subpath);

// Continuation probability of a walk whose throughput, relative to its start, is `throughput`.
// The floor keeps the weight of a survivor bounded.
inline float continuation_probability(float throughput) {
    return std::clamp(throughput, 0.05f, 1.0f);
}

}  // namespace usdmlt
