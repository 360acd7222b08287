// Bidirectional path tracing (Veach & Guibas 1994; Lafortune & Willems 1993): every strategy
// (s, t) with t ≥ 1, combined by the power heuristic; t = 1 splats to the whole film.
#pragma once

#include "film/film.hpp"
#include "integrators/settings.hpp"
#include "integrators/statistics.hpp"
#include "integrators/tiles.hpp"
#include "paths/subpath.hpp"

namespace usdmlt {

struct BidirectionalScratch {
    Subpath camera, light;
    SubpathVertex end;  // x0 of next-event estimation, or the lens of t = 1

    explicit BidirectionalScratch(int depth) : camera(depth + 2), light(depth + 1) {}
};

void render_bidirectional_unit(const Scene& scene, const Settings& settings, const Tiles& tiles,
                               int64_t index, BidirectionalScratch& scratch, Film& film,
                               UnitStatistics& statistics);

}  // namespace usdmlt
