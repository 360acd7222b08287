// Bootstrap of Metropolis light transport: samples of bidirectional path tracing whose entries
// (sample, s, t) estimate b = ∫ f* and are the paths that chains start from (Veach 1997, §11.3.1).
// What the split leaves to bidirectional path tracing is recorded by the same samples.
//
// The weight of an entry is v = w_{s,t} f*/p_{s,t}; its path is made again from the sample's number
// when a chain starts there. Starts are drawn ∝ v, systematically over the entries sorted by class
// of path and position in the image, so that they are spread as the light is.
#pragma once

#include <vector>

#include "integrators/path_target.hpp"
#include "integrators/pixel_subset.hpp"
#include "integrators/strategy_layers.hpp"

namespace usdmlt {

struct BootstrapEntry {
    uint64_t key;  // order: edges, class, position in the image along a Morton curve
    double weight;
    uint32_t sample, pass;  // pass: 0 where a sample is not a pixel's
    uint16_t s, t;
};

// A camera sample's part of the picture.
struct CameraSample {
    Spectrum value;
    bool covered = false;  // the camera's ray met a surface
};

class Bootstrap {
public:
    // `settings`: depth and min_edges bound the paths.
    Bootstrap(const Scene& scene, const Settings& settings, MutationContext& context,
              const ImportanceMap& importance, const Split& split, const PixelSubset& pixels);

    // Draws `count` samples of the stream `key` over the raster domain; returns b's estimate. 0: no
    // light was found.
    double draw(uint64_t key, uint32_t count, UnitStatistics& statistics);

    // The same by samples of pixels, one after the other: paths that end on the lens are recorded
    // times `splat_scale`, those of the camera's walk are returned. `starts`: how many will be
    // chosen; entries far lighter than one of them are kept by chance.
    void begin_pixels(uint64_t key, int starts);
    CameraSample add_pixel(const PixelSubset::Place& place, const PathRecorder& recorder,
                           double splat_scale, UnitStatistics& statistics);
    // Of all that were added: Σ v.
    double total() const { return total_; }

    // Of the light that arrives where roulette decides, in all samples so far.
    double fraction_going_on() const;

    const std::vector<BootstrapEntry>& entries() const { return entries_; }

    // Indices into entries() of `count` starts, by one offset u in [0, 1).
    void choose_starts(int count, double u, std::vector<size_t>& starts);

    // Makes the path of an entry, with vertices of the context's arena. False where rounding took
    // its light away.
    bool restore(const BootstrapEntry& entry, PathTarget& target, PathState& state,
                 UnitStatistics& statistics);

private:
    // False where the filter takes the raster point out of the domain.
    template <typename Sink>
    bool sample(uint32_t number, uint32_t pass, Sink& sink, UnitStatistics& statistics);

    const Scene& scene_;
    const Settings& settings_;
    MutationContext& context_;
    const ImportanceMap& importance_;
    const Split& split_;
    const PixelSubset& pixels_;
    StrategyScratch scratch_;
    Path path_;  // scratch
    uint64_t key_ = 0;
    int starts_ = 0;
    bool by_pixel_ = false;
    double total_ = 0;
    std::vector<BootstrapEntry> entries_;
};

}  // namespace usdmlt
