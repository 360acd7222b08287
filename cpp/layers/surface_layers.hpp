// What the camera's rays meet, by a pass of its own that is the same for every integrator: what is
// seen through the centre of each pixel, and averages over the pixel's filter, the lens and the
// shutter.
//
// Partly opaque surfaces: averages have all of them, each with the share of the light that comes
// from it; a centre shows the one at which half of the light is kept off.
//
// Objects are numbered: the meshes of the world, those of each instance in turn, the lights.
#pragma once

#include <vector>

#include "film/pixel_filter.hpp"
#include "integrators/scheduler.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

struct SurfaceLayersSettings {
    // Through the centres of the pixel and of the lens, when the shutter opens.
    bool objects = false, materials = false, places = false;  // places: triangle, barycentrics
    bool positions = false, shading_normals = false, geometric_normals = false, depths = false,
         motion = false;
    // Averages of so many samples per pixel.
    bool albedo = false, coverage = false;
    int samples = 1;
    int ranks = 1;  // of what a pixel has, the largest
    PixelFilter filter;

    bool centre() const {
        return objects || materials || places || positions || shading_normals ||
               geometric_normals || depths || motion;
    }
    bool averages() const { return albedo || coverage; }
};

// By pixel; what is not asked for is empty. −1: nothing.
struct SurfaceLayers {
    std::vector<int32_t> object, material, triangle;
    std::vector<Vec2f> barycentrics;                      // of corners 1 and 2
    std::vector<Vec3f> position;                          // world
    std::vector<Vec3f> shading_normal, geometric_normal;  // on the side that is seen
    std::vector<float> depth;                             // along the view axis; ∞: nothing
    std::vector<Vec2f> motion;  // of the point while the shutter is open: pixels right, and up

    std::vector<Vec3f> albedo;  // premultiplied by coverage
    // By pixel and rank; the coverages of all objects sum to the pixel's alpha.
    std::vector<int32_t> covering_object, covering_material;
    std::vector<float> object_coverage, material_coverage;
};

// Polls as units do; where that says stop, the averages that are left have a single sample.
SurfaceLayers surface_layers(const Scene& scene, const SurfaceLayersSettings& settings,
                             const RunLimits& limits);

}  // namespace usdmlt
