// What a render is asked to do. All of it is part of the plan's fingerprint.
#pragma once

#include <cstdint>

#include "film/pixel_filter.hpp"

namespace usdmlt {

enum class IntegratorKind : uint8_t { path, bidirectional };

struct Settings {
    IntegratorKind integrator = IntegratorKind::path;
    int samples = 64;   // per pixel
    int depth = 16;     // edges of the longest path
    int min_edges = 1;  // of the shortest path that is recorded
    uint64_t seed = 0;
    PixelFilter filter;
    bool background = true;  // environments are seen directly by the camera
};

}  // namespace usdmlt
