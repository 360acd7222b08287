// What mutations work with: the state space, the thread's memory, and the record of a change.
//
// A mutation replaces a run of vertices of x = x_0 … x_k:
//     y = x_0 … x_l, new vertices, x_m … x_k        (−1 ≤ l < m ≤ k + 1).
// The pair (l, m) and the run's length in y are the change; the way back is the same record read
// from y. Vertices are shared between x and y, so a change costs what it replaces.
//
// Every mutation is a struct of three functions (see mutations.hpp):
//     applies(context, x)              whether it can be chosen at x,
//     propose(context, x, y, change)   makes y, or fails, which is a rejection,
//     density(context, x, y, change)   T(x→y) given that it was chosen, from the pair alone.
#pragma once

#include <algorithm>
#include <numbers>
#include <vector>

#include "mutations/aimed_direction.hpp"
#include "paths/densities.hpp"
#include "paths/path.hpp"

namespace usdmlt {

// The raster points that paths may have: the image and the margin from which the pixel filter
// reaches into it.
struct RasterDomain {
    Vec2f lower, upper;
    double image_area;  // pixels

    RasterDomain(int width, int height, float margin)
        : lower{-margin, -margin},
          upper{float(width) + margin, float(height) + margin},
          image_area(double(width) * height) {}

    bool contains(Vec2f p) const {
        return p.x >= lower.x && p.y >= lower.y && p.x < upper.x && p.y < upper.y;
    }
    double area() const { return double(upper.x - lower.x) * (upper.y - lower.y); }
    // Camera densities are written for raster points uniform over the image.
    double density_scale() const { return image_area / area(); }
    Vec2f sample(Vec2f u) const {
        return {lower.x + (upper.x - lower.x) * u.x, lower.y + (upper.y - lower.y) * u.y};
    }
};

// Vertices of the paths of one thread; nothing is allocated while chains run.
class VertexArena {
public:
    explicit VertexArena(int capacity) : storage_(static_cast<size_t>(capacity)) {
        free_.reserve(storage_.size());
        for (Vertex& v : storage_) free_.push_back(&v);
    }
    Vertex* take() {
        Vertex* v = free_.back();
        free_.pop_back();
        return v;
    }
    // Gives back vertices first … last − 1 of a path.
    void give(const Path& path, int first, int last) {
        for (int i = first; i < last; ++i) free_.push_back(const_cast<Vertex*>(path.at(i).vertex));
    }
    void give_all(const Path& path) { give(path, 0, path.edges() + 1); }
    size_t available() const { return free_.size(); }

private:
    std::vector<Vertex> storage_;
    std::vector<Vertex*> free_;
};

struct Change {
    int l = -1, m = 0;  // kept: x_0 … x_l and x_m … x_k
    int m_y = 0;        // x_m is y_{m_y}
    int join = -1;      // edge y_{join−1} y_join was not traced: its visibility is to be tested

    Change reversed() const { return {l, m_y, m, -1}; }
};

// Probability P(k, s) with which independent paths are made: k edges, s vertices from the light.
class StrategyTable {
public:
    StrategyTable() = default;
    // weights[k][s], s = 0 … k.
    explicit StrategyTable(const std::vector<std::vector<double>>& weights);
    double probability(int k, int s) const {
        // The lens is not made from the light's side: s = k + 1 is asked for, and never.
        return k < static_cast<int>(probability_.size()) && s <= k
                   ? probability_[static_cast<size_t>(k)][static_cast<size_t>(s)]
                   : 0;
    }
    // False where no strategy is left.
    bool sample(double u, int& k, int& s) const;

private:
    std::vector<std::vector<double>> probability_;
};

// r = r_min·(r_max/r_min)^u: small moves and large ones equally often per octave (Veach 1997,
// §11.3.3, mirrored so that the density is ∝ 1/r between r_min and r_max).
struct LogarithmicRange {
    double min, max, log_ratio;

    LogarithmicRange(double min, double max) : min(min), max(max), log_ratio(std::log(max / min)) {}
    // Up to max, from min or a tenth of max, whichever is less.
    static LogarithmicRange of_a_decade_at_least(double min, double max) {
        return {std::min(min, 0.1 * max), max};
    }
    double sample(double u) const { return min * std::exp(u * log_ratio); }
    bool contains(double r) const { return r >= min && r <= max; }
    // Per unit length of r.
    double pdf(double r) const { return 1 / (r * log_ratio); }
    // Of a point in the plane at distance r, uniform in azimuth.
    double pdf_plane(double r) const { return pdf(r) / (2 * std::numbers::pi * r); }
    // Of a direction at angle r, in solid angle.
    double pdf_direction(double r) const { return pdf(r) / (2 * std::numbers::pi * std::sin(r)); }
};

struct MutationContext {
    const Scene& scene;
    RasterDomain domain;
    int min_edges, max_edges;
    StrategyTable strategies;                     // of the new-path mutation
    LogarithmicRange raster_range;                // of the image position, pixels
    LogarithmicRange direction_range{1e-4, 0.1};  // of inner chains, radians
    LogarithmicRange distance_range{1e-3, 0.5};   // in media, of the distance's logarithm

    // Of one thread.
    RandomStream random;
    RayCounters rays;
    VertexArena arena;
    ScaledDouble recorded;  // T(x→y) as the last proposal made it: a by-product, for tests
    DensityScratch scratch;
    // See aim.hpp: a proposal asks for them several times.
    Memo<AimedDirection> aims;
    // Strata of the screen: chain `chain` of a unit, proposal by proposal.
    uint64_t unit_key = 0;
    uint32_t chain = 0, lens_proposals = 0;

    MutationContext(const Scene& scene, const RasterDomain& domain, int min_edges, int max_edges);
};

// ---- Building y -------------------------------------------------------------------------------

// y = x_0 … x_l, `inserted` new vertices of the arena, x_m … x_k; sets change.m_y. What was new has
// to be given back if y is not kept.
inline void begin_replacement(MutationContext& context, const Path& x, Change& change, int inserted,
                              Path& y) {
    const int k = x.edges();
    change.m_y = change.l + 1 + inserted;
    y.vertices.resize(static_cast<size_t>(change.m_y + k + 1 - change.m));
    for (int i = 0; i <= change.l; ++i) y.at(i) = x.at(i);
    for (int i = change.l + 1; i < change.m_y; ++i) {
        y.at(i) = PathVertex{};
        y.at(i).vertex = context.arena.take();
    }
    for (int i = change.m; i <= k; ++i) y.at(i + change.m_y - change.m) = x.at(i);
    y.raster = x.raster;
    y.direct = x.direct;
    y.time = x.time;
}

// A vertex of the arena, to be filled in.
inline Vertex& fresh(Path& y, int i) { return const_cast<Vertex&>(y[i]); }

// Sets the raster point of a path whose last edge was joined; false off the domain.
inline bool project_end(const MutationContext& context, Path& y) {
    const int k = y.edges();
    Vec3f direction;
    return context.scene.camera.project(y[k - 1].position, y[k].position, y.time, y.raster,
                                        direction) &&
           context.domain.contains(y.raster);
}

// density_from_eye_side with raster points uniform over the domain.
inline double density_from_eye(const MutationContext& context, const Path& path, int i) {
    const double p = density_from_eye_side(context.scene, path, i);
    return i == path.edges() - 1 ? p * context.domain.density_scale() : p;
}

inline Ray ray_from(const Vertex& v, Vec3f direction) {
    return {offset_origin(v, direction), 0, direction, infinite_distance, v.time};
}

inline Ray camera_ray(const Camera& camera, Vec2f raster, Vec3f lens, float time) {
    const CameraRay ray = camera.ray(raster, lens, time);
    return {ray.origin, ray.tnear, ray.direction, ray.tfar, time};
}

}  // namespace usdmlt
