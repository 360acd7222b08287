// What a render is asked to do. All of it is part of the plan's fingerprint.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "film/pixel_filter.hpp"

namespace usdmlt {

struct LightPathAutomaton;

enum class IntegratorKind : uint8_t { path, bidirectional, metropolis };
// Who renders paths of up to two edges: path tracing alone, or what renders the others; automatic
// is the former, unless it finds light at few places only.
enum class DirectLight : uint8_t { automatic, separate, chains };

struct Settings {
    IntegratorKind integrator = IntegratorKind::path;
    int samples = 64;   // per pixel; mutations per pixel for metropolis
    int depth = 16;     // edges of the longest path
    int min_edges = 1;  // of the shortest path that is recorded
    uint64_t seed = 0;
    PixelFilter filter;
    bool background = true;   // environments are seen directly by the camera
    bool error_layer = true;  // the film keeps what the standard error needs
    // Whose layers the film keeps beside the picture; null: none.
    std::shared_ptr<const LightPathAutomaton> layers;
    int reduction = 1;  // pixels of the film are squares of so many of the camera's: for pilots

    // Metropolis only.
    DirectLight direct_light = DirectLight::automatic;
    bool selective = true;                 // light that bidirectional samples find is left to them
    bool two_stage = true;                 // the target is divided by a coarse picture
    std::vector<double> mutation_weights;  // by mutation; empty: the pilot decides

    // A raster point of a pixel of the film, ∝ the filter.
    template <typename Sampler>
    Vec2f sample_pixel(int x, int y, Sampler& sampler) const {
        Vec2f raster = (Vec2f{float(x), float(y)} + sampler.next_2d()) * float(reduction);
        if (filter.kind != PixelFilter::Kind::box)
            raster = raster + filter.offset(sampler.next_2d());
        return raster;
    }
};

}  // namespace usdmlt
