// Bootstrap of Metropolis light transport: samples of bidirectional path tracing whose entries
// (sample, s, t) estimate b = ∫ f* and are the paths that chains start from (Veach 1997, §11.3.1).
//
// The weight of an entry is v = w_{s,t} f*/p_{s,t}; its path is made again from the sample's number
// when a chain starts there. Starts are drawn ∝ v, systematically over the entries sorted by class
// of path and position in the image, so that they are spread as the light is.
#pragma once

#include <vector>

#include "integrators/path_target.hpp"
#include "integrators/strategies.hpp"

namespace usdmlt {

struct BootstrapEntry {
    uint64_t key;  // order: edges, class, position in the image along a Morton curve
    double weight;
    uint32_t sample;
    uint16_t s, t;
};

class Bootstrap {
public:
    // `settings`: depth and min_edges bound the paths.
    Bootstrap(const Scene& scene, const Settings& settings, MutationContext& context,
              const ImportanceMap& importance);

    // Draws `count` samples of the stream `key`; returns b's estimate. 0: no light was found.
    double draw(uint64_t key, uint32_t count, UnitStatistics& statistics);

    const std::vector<BootstrapEntry>& entries() const { return entries_; }

    // Indices into entries() of `count` starts, by one offset u in [0, 1).
    void choose_starts(int count, double u, std::vector<size_t>& starts);

    // Makes the path of an entry, with vertices of the context's arena. False where rounding took
    // its light away.
    bool restore(const BootstrapEntry& entry, PathTarget& target, PathState& state,
                 UnitStatistics& statistics);

private:
    template <typename Sink>
    void sample(uint32_t index, Sink& sink, UnitStatistics& statistics, Vec2f& raster);

    const Scene& scene_;
    const Settings& settings_;
    MutationContext& context_;
    const ImportanceMap& importance_;
    StrategyScratch scratch_;
    Path path_;  // scratch
    uint64_t key_ = 0;
    double total_ = 0;
    std::vector<BootstrapEntry> entries_;
};

}  // namespace usdmlt
