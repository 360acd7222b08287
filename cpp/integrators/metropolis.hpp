// Metropolis light transport (Veach & Guibas 1997).
//
// A unit of work is a round of its own: it draws a bootstrap, starts chains ∝ its entries' weights,
// and splats b_r f/f*, b_r being its own estimate of b. That is unbiased for any size of bootstrap
// (the expected deposit of a chain that starts at entry i is that entry's own estimate, v_i), and
// the average over units converges; nothing is shared between units.
//
// The bootstrap's samples are bidirectional path tracing of the image's pixels, and record what the
// split leaves to it (see Split). A pilot, which deposits nothing, fixes what may be adapted: the
// split, the share of each part in the work, with which strategies new paths are made, and the
// importance map. If the settings say so, paths of up to two edges are path traced alone: then b,
// bootstrap and mutations leave them out.
#pragma once

#include <memory>
#include <span>

#include "integrators/bootstrap.hpp"
#include "integrators/metropolis_statistics.hpp"
#include "integrators/path_tracer.hpp"
#include "paths/guide.hpp"

namespace usdmlt {

struct MetropolisPlan {
    MetropolisPlan(const Scene& scene, const Settings& settings);

    int64_t mutations_per_unit() const { return int64_t(chains) * steps; }
    double mutations_per_sample() const {
        return double(mutations_per_unit()) / (pixels.samples_per_pixel() * image_pixels);
    }
    // Leaves chains out where the units of one pass over the pixels would be more than so much work
    // per pixel.
    void shorten(double work_per_pixel);
    // A number that tells plans apart, down to the last bit of what the pilot measured.
    uint64_t digest() const;
    // Bounds of the chains' paths; chains that have none do nothing.
    bool has_chains() const { return paths.min_edges <= paths.depth; }

    bool direct_separately = false;  // as resolved
    Settings paths;                  // of the chains and the bootstrap
    Settings direct;                 // of the path tracer's part
    RasterDomain domain;
    int chains, steps;    // of a unit
    double image_pixels;  // of the film
    double work;          // of a unit, in mutations
    std::vector<double> mutation_weights;
    PixelSubset pixels;  // samples of the bootstrap
    Split split;
    Spread spread;
    StrategyTable strategies;
    std::shared_ptr<const Guide> guide;  // of walks from the eye; null: there is nothing to guide
    ImportanceMap importance;
    uint64_t pilot_rays = 0;
    double relative_error = 1;  // of chains and split, to bidirectional samples alone
    PilotNotes::Errors others;  // errors of the other integrators on the chains' light
};

// Memory of one thread.
struct MetropolisScratch {
    MutationContext context;
    Bootstrap bootstrap;
    PathTarget target;
    MutationSelection selection;
    PathState x, y;
    PathState start;  // of chains, as it is spread
    std::vector<size_t> starts;
    ChainCounts spreading;  // of its steps
    MetropolisUnitStatistics statistics;
    PathTracerScratch path;
    LayerScratch* layers = nullptr;  // of the thread; null: the film has none

    MetropolisScratch(const Scene& scene, const MetropolisPlan& plan);
};

// Moves scratch.start within its band, see Spread.
void move_start(MetropolisScratch& scratch, int64_t steps, RandomStream& random);

// Draws starts from the bootstrap's entries and spreads them by `move`, which is move_start unless
// a test has another: calls f(chain, entry) with scratch.start for each chain.
template <typename Move, typename F>
void for_each_start(MetropolisScratch& scratch, const Spread& spread, int chains, uint64_t key,
                    Move&& move, F&& f) {
    RandomStream offset(hash_key(key, 1));
    scratch.bootstrap.choose_starts(chains, offset.next_double(), scratch.starts);
    for (int c = 0, next; c < chains; c = next) {
        const size_t index = scratch.starts[size_t(c)];
        for (next = c + 1; next < chains && scratch.starts[size_t(next)] == index;) ++next;
        const BootstrapEntry& entry = scratch.bootstrap.entries()[index];
        if (!scratch.bootstrap.restore(entry, scratch.target, scratch.start,
                                       scratch.statistics.bootstrap))
            continue;
        RandomStream random(hash_key(hash_key(key, 4), uint64_t(c)));
        const double u = random.next_double();
        int64_t done = 0;
        for (int i = c; i < next; ++i) {
            scratch.context.chain = static_cast<uint32_t>(i);
            scratch.context.lens_proposals = 0;
            const int64_t steps = spread.steps(scratch.start.band, i - c, next - c, u);
            move(scratch, steps - done, random);
            done = steps;
            f(i, entry);
        }
        scratch.context.arena.give_all(scratch.start.path);
    }
}

void render_metropolis_unit(const Scene& scene, const MetropolisPlan& plan, int64_t index,
                            MetropolisScratch& scratch, Film& film, UnitSplats& splats,
                            UnitStatistics& statistics);

}  // namespace usdmlt
