// What the camera's rays meet, by a pass of its own that is the same for every integrator: what is
// seen through the centre of each pixel, and averages over the pixel's filter, the lens and the
// shutter.
//
// Partly opaque surfaces: averages have all of them, each with the share of the light that comes
// from it; a centre shows the one at which half of the light is kept off.
#pragma once

#include <functional>
#include <vector>

#include "film/pixel_filter.hpp"
#include "integrators/scheduler.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

// A surface as the scene counts it: of a mesh that is placed or instanced, or of a light's shape.
struct SurfaceKey {
    uint32_t mesh = invalid_index, instance = invalid_index, light = invalid_index;
    uint32_t material = invalid_index;
    auto operator<=>(const SurfaceKey&) const = default;
    bool exists() const { return mesh != invalid_index || light != invalid_index; }
};

// At the shutter's opening, through the centres of the pixel and of the lens.
struct SurfaceAtCentre {
    SurfaceKey key;
    uint32_t triangle = 0;
    Vec2f barycentrics;                      // of corners 1 and 2
    Vec3d position;                          // world
    Vec3f shading_normal, geometric_normal;  // on the side that is seen
    float depth = 0;                         // along the view axis
    Vec2f motion;  // of the point while the shutter is open: pixels to the right, and up
};

struct SurfaceLayersSettings {
    PixelFilter filter;
    int samples = 0;  // of the averages, per pixel; 0: there are none
    int ranks = 0;    // surfaces that are kept by pixel, the largest first
};

struct SurfaceLayers {
    std::vector<SurfaceAtCentre> centre;  // by pixel; no key: nothing is there
    std::vector<Spectrum> albedo;         // premultiplied by coverage
    // By pixel and rank; the coverages of all surfaces sum to the pixel's alpha.
    std::vector<SurfaceKey> keys;
    std::vector<float> coverage;
    std::vector<uint32_t> material;
    std::vector<float> material_coverage;
};

// Polls as units do; where that says stop, what is left has a single sample per pixel.
SurfaceLayers surface_layers(const Scene& scene, const SurfaceLayersSettings& settings,
                             const RunLimits& limits);

}  // namespace usdmlt
