// Path tracing: next-event estimation and BSDF sampling, combined by the power heuristic.
#pragma once

#include <memory>

#include "film/film.hpp"
#include "integrators/settings.hpp"
#include "integrators/statistics.hpp"
#include "integrators/tiles.hpp"
#include "paths/light_path_classes.hpp"
#include "paths/subpath.hpp"

namespace usdmlt {

// The memory of one thread.
struct PathTracerScratch {
    SubpathVertex vertices[4];
    LayerScratch* layers = nullptr;  // gets the parts of the radiance, unless null
};

// Radiance along one camera sample, and its alpha.
Spectrum trace_path(const Scene& scene, const Settings& settings, Sampler& sampler, Vec2f raster,
                    PathTracerScratch& scratch, UnitStatistics& statistics, float& alpha);

void render_path_unit(const Scene& scene, const Settings& settings, const Tiles& tiles,
                      int64_t index, PathTracerScratch& scratch, Film& film,
                      UnitStatistics& statistics);

}  // namespace usdmlt
