// Bidirectional path tracing (Veach & Guibas 1994; Lafortune & Willems 1993): every strategy
// (s, t) with t ≥ 1, combined by the power heuristic; t = 1 splats to the whole film.
#pragma once

#include "film/film.hpp"
#include "integrators/strategy_layers.hpp"
#include "integrators/tiles.hpp"

namespace usdmlt {

void render_bidirectional_unit(const Scene& scene, const Settings& settings, const Tiles& tiles,
                               int64_t index, StrategyScratch& scratch, LayerScratch* layers,
                               Film& film, UnitSplats& splats, UnitStatistics& statistics);

}  // namespace usdmlt
