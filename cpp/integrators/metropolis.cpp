#include "integrators/metropolis.hpp"

#include <cmath>

namespace usdmlt {
namespace {

// Mutations of a unit: few enough to last a fraction of a second, some per pixel of small images.
constexpr int least_mutations = 1 << 13, most_mutations = 1 << 17, mutations_per_pixel = 4;
constexpr int steps_per_chain = 128;
// Camera samples of the part that is path traced, per mutation.
constexpr double direct_samples_per_mutation = 1.0 / 4;

constexpr double bootstrap_share = 0.25;  // of the rays of bootstrap and chains
// A reduced render is a pilot itself.
uint32_t pilot_samples_of(const Settings& settings) { return settings.reduction > 1 ? 1024 : 4096; }
constexpr int pilot_steps = 64, trial_steps = 8;  // of as many chains as a unit has
constexpr double photons_per_pixel = 2, least_photons = 0x1p12, most_photons = 0x1p17;
constexpr double uniform_strategies = 0.1;

// By mutation: new path, bidirectional, lens, caustic, multi-chain, lens subpath. Measured by error
// in equal time: with starts as many and as stratified as these, small moves pay most.
const std::vector<double> default_weights = {0.01, 0.08, 0.55, 0.20, 0.25, 0.02};

uint64_t unit_key(const Settings& settings, uint64_t purpose, uint64_t index) {
    return hash_key(hash_key(settings.seed, 0x6d6c74 + purpose), index);
}

uint64_t rays_of(const RayCounters& rays) { return rays.closest + rays.shadow; }

// Chains from the starts of a bootstrap, `steps` each.
void run_chains(MetropolisScratch& scratch, int chains, int steps, uint64_t key) {
    MutationContext& context = scratch.context;
    RandomStream offset(hash_key(key, 1));
    scratch.bootstrap.choose_starts(chains, offset.next_double(), scratch.starts);
    context.unit_key = hash_key(key, 2);
    for (int c = 0; c < chains; ++c) {
        const BootstrapEntry& start = scratch.bootstrap.entries()[scratch.starts[size_t(c)]];
        if (!scratch.bootstrap.restore(start, scratch.target, scratch.x,
                                       scratch.statistics.bootstrap))
            continue;
        context.random = RandomStream(hash_key(hash_key(key, 3), uint64_t(c)));
        context.chain = static_cast<uint32_t>(c);
        context.lens_proposals = 0;
        run_chain(scratch.target, scratch.selection, scratch.x, scratch.y, steps, context.random,
                  scratch.statistics.chains);
        context.arena.give_all(scratch.x.path);
    }
    scratch.statistics.chains.finish();
}

// P(k, s): the pilot's energies, mixed with all that can be.
StrategyTable strategy_table(const Settings& paths, const std::vector<BootstrapEntry>& entries) {
    std::vector<std::vector<double>> weights(static_cast<size_t>(paths.depth) + 1);
    int count = 0;
    double total = 0;
    for (int k = 0; k <= paths.depth; ++k) {
        weights[size_t(k)].assign(size_t(k) + 1, 0);
        if (k >= paths.min_edges) count += k == 1 ? 1 : k + 1;
    }
    for (const BootstrapEntry& e : entries) {
        weights[size_t(e.s + e.t - 1)][e.s] += e.weight;
        total += e.weight;
    }
    const double uniform = total > 0 ? uniform_strategies : 1;
    for (int k = std::max(paths.min_edges, 1); k <= paths.depth; ++k)
        for (int s = 0; s <= (k == 1 ? 0 : k); ++s) {
            double& w = weights[size_t(k)][size_t(s)];
            w = (total > 0 ? (1 - uniform) * w / total : 0) + uniform / count;
        }
    return StrategyTable(weights);
}

// The path traced part of the picture, a few samples per cell. Returns the rays it took.
uint64_t add_direct_light(const Scene& scene, const MetropolisPlan& plan, uint64_t key,
                          PathTracerScratch& scratch, CoarsePicture& picture) {
    constexpr uint32_t samples = 4 * CoarsePicture::count;
    UnitStatistics statistics(plan.direct.depth);
    for (uint32_t i = 0; i < samples; ++i) {
        Sampler sampler(key, i, 16);
        const Vec2f raster = plan.domain.sample(sampler.next_2d());
        float alpha;
        const Spectrum value =
            trace_path(scene, plan.direct, sampler, raster, scratch, statistics, alpha);
        picture.add(raster, luminance(value) * CoarsePicture::count / samples);
    }
    return rays_of(statistics.rays);
}

// Whether path tracing finds direct light too seldom: at few places, or nowhere. A small hole is
// like that; what is seen or lit as usual is found almost everywhere.
bool direct_light_is_rare(const Scene& scene, const Settings& settings) {
    constexpr uint32_t places = 4096, fewest = places / 64;
    Settings direct = settings;
    direct.depth = std::min(settings.depth, 2);
    direct.min_edges = 1;
    PathTracerScratch scratch;
    UnitStatistics statistics(direct.depth);
    uint32_t lit = 0;
    for (uint32_t i = 0; i < places; ++i) {
        Sampler sampler(unit_key(settings, 1, 6), i, 8);
        const Vec2f u = sampler.next_2d();
        const Vec2f raster{u.x * float(scene.camera.width), u.y * float(scene.camera.height)};
        float alpha;
        lit += !is_black(trace_path(scene, direct, sampler, raster, scratch, statistics, alpha));
    }
    return lit < fewest;
}

std::shared_ptr<const Guide> make_guide(const Scene& scene, const Settings& settings, double pixels,
                                        RayCounters& rays) {
    const int subpaths =
        static_cast<int>(std::clamp(photons_per_pixel * pixels, least_photons, most_photons));
    auto guide =
        std::make_shared<Guide>(trace_photons(scene, unit_key(settings, 1, 0), subpaths, rays));
    return guide->empty() ? nullptr : guide;
}

}  // namespace

MetropolisPlan::MetropolisPlan(const Scene& scene, const Settings& settings)
    : direct_separately(settings.direct_separately &&
                        !(settings.direct_by_pilot && direct_light_is_rare(scene, settings))),
      paths(settings),
      direct(settings),
      domain(scene.camera.width, scene.camera.height, settings.filter.reach()),
      mutation_weights(settings.mutation_weights.empty() ? default_weights
                                                         : settings.mutation_weights) {
    if (direct_separately) {
        paths.min_edges = std::max(settings.min_edges, 3);
        direct.depth = std::min(settings.depth, 2);
    } else {
        // The path tracer sees what the camera covers, and records no light.
        direct.depth = 1;
        direct.min_edges = 2;
    }
    const Tiles tiles(scene.camera.width / settings.reduction,
                      scene.camera.height / settings.reduction);
    const double pixels = double(tiles.width) * tiles.height;
    const int mutations = static_cast<int>(
        std::clamp(pixels * mutations_per_pixel, double(least_mutations), double(most_mutations)));
    steps = steps_per_chain;
    chains = mutations / steps;
    direct_tiles =
        std::max(1, static_cast<int>(std::lround(mutations * direct_samples_per_mutation *
                                                 double(tiles.count()) / pixels)));
    if (!has_chains()) return;

    RayCounters photon_rays;
    guide = make_guide(scene, settings, pixels, photon_rays);
    pilot_rays = rays_of(photon_rays);
    const uint32_t pilot_samples = pilot_samples_of(settings);
    bootstrap_samples = pilot_samples;
    strategies = strategy_table(paths, {});
    {
        // The first stage: a coarse picture by chains of the plain target, and of the rest.
        MetropolisScratch scratch(scene, *this);
        PilotNotes notes(domain);
        scratch.target.recorder.pilot = &notes;
        const double b = scratch.bootstrap.draw(unit_key(settings, 1, 1), pilot_samples,
                                                scratch.statistics.bootstrap);
        if (b > 0) run_chains(scratch, chains, pilot_steps, unit_key(settings, 1, 2));
        CoarsePicture& picture = notes.picture;
        picture.scale(b * CoarsePicture::count / (double(chains) * pilot_steps));
        pilot_rays +=
            rays_of(scratch.statistics.bootstrap.rays) + rays_of(scratch.context.rays) +
            add_direct_light(scene, *this, unit_key(settings, 1, 5), scratch.path, picture);
        others = notes.errors(b, picture);
        if (settings.two_stage) importance = ImportanceMap(picture);
    }

    // What a unit costs, and which strategies find the light.
    MetropolisScratch scratch(scene, *this);
    if (!(scratch.bootstrap.draw(unit_key(settings, 1, 3), pilot_samples,
                                 scratch.statistics.bootstrap) > 0))
        return;
    strategies = strategy_table(paths, scratch.bootstrap.entries());
    scratch.context.strategies = strategies;
    const double rays_per_sample =
        double(rays_of(scratch.statistics.bootstrap.rays)) / pilot_samples;
    run_chains(scratch, chains, trial_steps, unit_key(settings, 1, 4));
    const double rays_per_mutation =
        double(rays_of(scratch.context.rays)) / (double(chains) * trial_steps);
    pilot_rays += rays_of(scratch.statistics.bootstrap.rays) + rays_of(scratch.context.rays);
    const double count = bootstrap_share / (1 - bootstrap_share) * double(mutations_per_unit()) *
                         rays_per_mutation / rays_per_sample;
    bootstrap_samples =
        static_cast<uint32_t>(std::clamp(count, double(chains), double(mutations_per_unit())));
}

MetropolisScratch::MetropolisScratch(const Scene& scene, const MetropolisPlan& plan)
    : context(scene, plan.domain, plan.paths.min_edges, plan.paths.depth),
      bootstrap(scene, plan.paths, context, plan.importance),
      target(context, plan.importance, plan.paths.background),
      selection(plan.mutation_weights),
      statistics(plan.paths.depth) {
    context.strategies = plan.strategies;
    context.rays.guide = statistics.bootstrap.rays.guide = plan.guide.get();
    for (PathState* state : {&x, &y}) state->path.vertices.reserve(size_t(plan.paths.depth) + 2);
    uint32_t enabled = 0;
    for (size_t m = 0; m < plan.mutation_weights.size(); ++m)
        enabled |= uint32_t(plan.mutation_weights[m] > 0) << m;
    target.enable(enabled);
}

void render_metropolis_unit(const Scene& scene, const MetropolisPlan& plan, const Tiles& tiles,
                            int64_t index, MetropolisScratch& scratch, Film& film,
                            UnitStatistics& statistics) {
    for (int i = 0; i < plan.direct_tiles; ++i)
        render_path_unit(scene, plan.direct, tiles, index * plan.direct_tiles + i, scratch.path,
                         film, statistics);
    MetropolisUnitStatistics& counts = scratch.statistics;
    counts.reset();
    if (!plan.has_chains()) return;
    RayCounters& rays = scratch.context.rays;
    rays.closest = rays.shadow = 0;
    rays.recorder = counts.bootstrap.rays.recorder = statistics.rays.recorder;

    const uint64_t key = unit_key(plan.paths, 0, uint64_t(index));
    const uint64_t non_finite = scratch.target.non_finite();
    counts.bootstrap_samples = plan.bootstrap_samples;
    counts.b = scratch.bootstrap.draw(hash_key(key, 0), plan.bootstrap_samples, counts.bootstrap);
    if (counts.b > 0) {
        scratch.target.recorder = {.pilot = nullptr,
                                   .film = &film,
                                   .filter = &plan.paths.filter,
                                   .reduction = float(plan.paths.reduction),
                                   .classes = &counts.classes,
                                   .scale = counts.b,
                                   .batch = static_cast<int>(index % Film::batches)};
        run_chains(scratch, plan.chains, plan.steps, key);
    }
    statistics.rays.closest += rays.closest + counts.bootstrap.rays.closest;
    statistics.rays.shadow += rays.shadow + counts.bootstrap.rays.shadow;
    statistics.non_finite += counts.bootstrap.non_finite + counts.chains.non_finite +
                             scratch.target.non_finite() - non_finite;
}

}  // namespace usdmlt
