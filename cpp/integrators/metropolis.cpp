#include "integrators/metropolis.hpp"

#include <bit>
#include <cmath>

namespace usdmlt {
namespace {

// Of a unit, in mutations: few enough to last a fraction of a second, some per pixel of small
// images.
constexpr double least_work = 0x1p13, most_work = 0x1p17, work_per_pixel = 4;
constexpr int steps_per_chain = 128;
// Camera samples, per mutation, of plans without chains.
constexpr double direct_samples_per_mutation = 1.0 / 4;
constexpr int direct_stratified_pairs = 11;

// Of a unit's work, where nothing is split.
constexpr double bootstrap_share = 0.25;
// Of chains, where units are shortened.
constexpr double least_chains_kept = 0.25;
// Time of a ray of bidirectional samples, many of which are shadow rays, in those of a mutation;
// measured.
constexpr double cost_of_sample_rays = 0.55;
// A reduced render is a pilot itself.
uint32_t pilot_samples_of(const Settings& settings) { return settings.reduction > 1 ? 1024 : 4096; }
constexpr int pilot_steps = 64;  // of as many chains as a unit has
// Of the pilot's picture: cells, and mutations over which it is smoothed.
constexpr double least_cells = 0x1p10, most_cells = 0x1p16, smoothed_mutations = 512;
constexpr uint32_t direct_pilot_samples = 4096;
constexpr uint32_t continuation_samples = 512;
constexpr double least_continuation = 0.3;
constexpr double photons_per_pixel = 2, least_photons = 0x1p12, most_photons = 0x1p17;
constexpr double uniform_strategies = 0.1;

// By mutation: new path, bidirectional, lens, caustic, multi-chain, lens subpath, glossy lens,
// glossy caustic, aimed. Measured by error in equal time: with starts as many and as stratified as
// these, small moves pay most; lens subpaths, which go anywhere on the screen, unclump its blocks.
const std::vector<double> default_weights = {0.01, 0.08, 0.55, 0.20, 0.25, 0.20, 0.8, 0.6, 0.5};

uint64_t unit_key(const Settings& settings, uint64_t purpose, uint64_t index) {
    return hash_key(hash_key(settings.seed, 0x6d6c74 + purpose), index);
}

uint64_t rays_of(const RayCounters& rays) { return rays.closest + rays.shadow; }

void copy_state(MutationContext& context, const PathState& from, PathState& to) {
    to = from;
    for (PathVertex& v : to.path.vertices) {
        Vertex* copy = context.arena.take();
        *copy = *v.vertex;
        v.vertex = copy;
    }
}

// Chains from the starts of a bootstrap, `steps` each.
void run_chains(MetropolisScratch& scratch, const Spread& spread, int chains, int steps,
                uint64_t key) {
    MutationContext& context = scratch.context;
    context.unit_key = hash_key(key, 2);
    for_each_start(scratch, spread, chains, key, move_start, [&](int c, const BootstrapEntry&) {
        copy_state(context, scratch.start, scratch.x);
        context.random = RandomStream(hash_key(hash_key(key, 3), uint64_t(c)));
        run_chain(scratch.target, scratch.selection, scratch.x, scratch.y, steps, context.random,
                  scratch.statistics.chains);
        context.arena.give_all(scratch.x.path);
    });
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

// Light of up to two edges by path tracing, as a few samples find it.
struct DirectPilot {
    std::vector<std::pair<Vec2f, double>> samples;  // raster, brightness
    uint64_t rays = 0;

    // At few places, or nowhere. A small hole is like that; what is seen or lit as usual is found
    // almost everywhere.
    bool is_rare() const {
        constexpr size_t fewest = direct_pilot_samples / 64;
        return size_t(std::ranges::count_if(samples, [](const auto& s) { return s.second > 0; })) <
               fewest;
    }
    void add_to(CoarsePicture& picture) const {
        for (const auto& [raster, brightness] : samples)
            picture.add(raster, brightness * double(picture.count()) / double(samples.size()));
    }
};

DirectPilot try_direct_light(const Scene& scene, Settings direct, const RasterDomain& domain) {
    direct.depth = std::min(direct.depth, 2);
    DirectPilot pilot;
    PathTracerScratch scratch;
    UnitStatistics statistics(direct.depth);
    for (uint32_t i = 0; i < direct_pilot_samples; ++i) {
        Sampler sampler(unit_key(direct, 1, 5), i, 16);
        const Vec2f raster = domain.sample(sampler.next_2d());
        float alpha;
        pilot.samples.emplace_back(raster, luminance(trace_path(scene, direct, sampler, raster,
                                                                scratch, statistics, alpha)));
    }
    pilot.rays = rays_of(statistics.rays);
    return pilot;
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
    : paths(settings),
      direct(settings),
      domain(scene.camera.width, scene.camera.height, settings.filter.reach()),
      mutation_weights(settings.mutation_weights.empty() ? default_weights
                                                         : settings.mutation_weights),
      pixels(scene.camera.width / settings.reduction, scene.camera.height / settings.reduction,
             settings.filter, settings.reduction) {
    DirectPilot direct_light;
    if (settings.direct_light != DirectLight::chains) {
        direct_light = try_direct_light(scene, settings, domain);
        pilot_rays += direct_light.rays;
        direct_separately =
            settings.direct_light == DirectLight::separate || !direct_light.is_rare();
    }
    if (direct_separately) {
        paths.min_edges = std::max(settings.min_edges, 3);
        direct.depth = std::min(settings.depth, 2);
    }
    image_pixels = double(scene.camera.width / settings.reduction) *
                   (scene.camera.height / settings.reduction);
    work = std::clamp(image_pixels * work_per_pixel, least_work, most_work);
    steps = steps_per_chain;
    chains = static_cast<int>(work) / steps;
    pixels.set_samples(work * direct_samples_per_mutation);
    if (!has_chains()) return;

    RayCounters photon_rays;
    guide = make_guide(scene, settings, image_pixels, photon_rays);
    pilot_rays += rays_of(photon_rays);
    const uint32_t pilot_samples = pilot_samples_of(settings);
    strategies = strategy_table(paths, {});
    if (settings.selective) {
        MetropolisScratch scratch(scene, *this);
        scratch.bootstrap.draw(unit_key(settings, 1, 6), continuation_samples,
                               scratch.statistics.bootstrap);
        pilot_rays += rays_of(scratch.statistics.bootstrap.rays);
        split.continuation =
            std::clamp(scratch.bootstrap.fraction_going_on(), least_continuation, 1.0);
    }
    double sample_cost = 1, share = 0.5;
    {
        // The first stage: a coarse picture by chains of the plain target, and of the rest.
        MetropolisScratch scratch(scene, *this);
        PilotNotes notes(domain, std::clamp(image_pixels, least_cells, most_cells), split);
        scratch.target.recorder.pilot = &notes;
        const double b = scratch.bootstrap.draw(unit_key(settings, 1, 1), pilot_samples,
                                                scratch.statistics.bootstrap);
        if (b > 0) run_chains(scratch, {}, chains, pilot_steps, unit_key(settings, 1, 2));
        CoarsePicture& picture = notes.picture;
        const double pilot_mutations = double(chains) * pilot_steps;
        picture.scale(b * double(picture.count()) / pilot_mutations);
        if (direct_separately) direct_light.add_to(picture);
        RayCounters seen_rays;
        picture.smooth(seen_surfaces(scene, picture, seen_rays),
                       smoothed_mutations * double(picture.count()) / pilot_mutations);
        const uint64_t sample_rays = rays_of(scratch.statistics.bootstrap.rays),
                       mutation_rays = rays_of(scratch.context.rays);
        pilot_rays += sample_rays + mutation_rays + rays_of(seen_rays);
        others = notes.errors(b, picture);
        if (settings.two_stage) importance = ImportanceMap(picture);

        double direct_cost = 0;
        if (sample_rays > 0 && mutation_rays > 0) {
            const double cost_of_ray =
                cost_of_sample_rays * pilot_mutations / double(mutation_rays);
            sample_cost = cost_of_ray * double(sample_rays) / pilot_samples;
            if (direct_separately)
                direct_cost = cost_of_ray * double(direct_light.rays) / direct_pilot_samples;
        }
        share = bootstrap_share;
        if (settings.selective) {
            const PilotNotes::Plan plan =
                notes.plan_split(b, picture, importance, sample_cost, direct_cost);
            split = plan.split;
            relative_error = plan.relative_error;
            share = plan.share;
        }
        sample_cost += direct_cost;
    }
    pixels.set_samples(work * share / sample_cost);
    const double samples = pixels.samples_per_pixel() * image_pixels;
    chains = std::max(
        1, static_cast<int>(std::lround(samples * sample_cost * (1 - share) / (share * steps))));
    work = double(mutations_per_unit()) + samples * sample_cost;

    // Which strategies find the light that is left to the chains.
    MetropolisScratch scratch(scene, *this);
    const double b = scratch.bootstrap.draw(unit_key(settings, 1, 3), pilot_samples,
                                            scratch.statistics.bootstrap);
    if (b > 0) spread.mean_weight = b * samples / chains;
    pilot_rays += rays_of(scratch.statistics.bootstrap.rays);
    strategies = strategy_table(paths, scratch.bootstrap.entries());
}

void MetropolisPlan::shorten(double work_per_pixel) {
    if (!has_chains()) return;
    const double wanted = work_per_pixel * image_pixels / double(pixels.units_per_pass());
    const double samples = work - double(mutations_per_unit());
    if (wanted >= work) return;
    const int before = chains;
    chains = std::clamp(static_cast<int>((wanted - samples) / steps),
                        std::max(static_cast<int>(chains * least_chains_kept), 1), chains);
    spread.mean_weight *= double(before) / chains;
    work = double(mutations_per_unit()) + samples;
}

uint64_t MetropolisPlan::digest() const {
    uint64_t key = hash_key(uint64_t(direct_separately), pilot_rays);
    for (const int n : {chains, steps}) key = hash_key(key, uint64_t(n));
    std::vector<double> numbers = mutation_weights;
    numbers.insert(numbers.end(),
                   {work, pixels.samples_per_pixel(), split.c_squared, split.continuation,
                    relative_error, others.path, others.bidirectional, spread.mean_weight});
    for (const double x : numbers) key = hash_key(key, std::bit_cast<uint64_t>(x));
    return key;
}

MetropolisScratch::MetropolisScratch(const Scene& scene, const MetropolisPlan& plan)
    : context(scene, plan.domain, plan.paths.min_edges, plan.paths.depth),
      bootstrap(scene, plan.paths, context, plan.importance, plan.split, plan.pixels),
      target(context, plan.importance, plan.split, plan.spread, plan.paths.background),
      selection(plan.mutation_weights),
      spreading(int(plan.mutation_weights.size())),
      statistics(plan.paths.depth) {
    context.strategies = plan.strategies;
    context.rays.guide = statistics.bootstrap.rays.guide = plan.guide.get();
    for (PathState* state : {&x, &y, &start})
        state->path.vertices.reserve(size_t(plan.paths.depth) + 2);
    uint32_t enabled = 0;
    for (size_t m = 0; m < plan.mutation_weights.size(); ++m)
        enabled |= uint32_t(plan.mutation_weights[m] > 0) << m;
    target.enable(enabled);
}

void move_start(MetropolisScratch& scratch, int64_t steps, RandomStream& random) {
    if (steps == 0) return;
    scratch.context.random = random;
    scratch.target.band = scratch.start.band;
    run_chain(scratch.target, scratch.selection, scratch.start, scratch.y, steps,
              scratch.context.random, scratch.spreading);
    scratch.target.band = 0;
    random = scratch.context.random;
}

namespace {

// The path traced part of a pixel, added to value and alpha.
void add_direct_light(const Scene& scene, const MetropolisPlan& plan,
                      const PixelSubset::Place& place, PathTracerScratch& scratch,
                      UnitStatistics& statistics, double sum[4]) {
    Sampler sampler(hash_key(unit_key(plan.direct, 2, 0), place.pixel), place.pass,
                    direct_stratified_pairs);
    const Vec2f raster = plan.direct.sample_pixel(place.x, place.y, sampler);
    float alpha;
    const Spectrum value =
        trace_path(scene, plan.direct, sampler, raster, scratch, statistics, alpha);
    for (int c = 0; c < 3; ++c) sum[c] += value[c];
    if (!plan.has_chains()) sum[3] += alpha;
    ++statistics.samples;
}

}  // namespace

void render_metropolis_unit(const Scene& scene, const MetropolisPlan& plan, int64_t index,
                            MetropolisScratch& scratch, Film& film, UnitSplats& splats,
                            UnitStatistics& statistics) {
    MetropolisUnitStatistics& counts = scratch.statistics;
    counts.reset();
    RayCounters& rays = scratch.context.rays;
    rays.closest = rays.shadow = 0;
    rays.recorder = counts.bootstrap.rays.recorder = statistics.rays.recorder;
    scratch.target.recorder = {.pilot = nullptr,
                               .film = &film,
                               .filter = &plan.paths.filter,
                               .reduction = float(plan.paths.reduction),
                               .classes = &counts.classes,
                               .scale = 0,
                               .unit = &splats,
                               .layers = scratch.layers};
    scratch.path.layers = scratch.layers;
    LayerSums* const parts = scratch.layers ? &scratch.layers->sample : nullptr;
    const uint64_t non_finite = scratch.target.non_finite();

    // Camera samples; splats of the film are normalised by the number of mutations.
    const double samples = plan.pixels.samples_per_pixel() * plan.image_pixels;
    const double splat_scale = plan.mutations_per_sample();
    scratch.bootstrap.begin_pixels(unit_key(plan.paths, 3, 0), plan.chains);
    plan.pixels.for_each(index, unit_key(plan.paths, 4, 0), [&](const PixelSubset::Place& place) {
        double sum[4] = {0, 0, 0, 0};
        if (parts) parts->clear();
        if (plan.has_chains()) {
            const CameraSample sample = scratch.bootstrap.add_pixel(place, scratch.target.recorder,
                                                                    splat_scale, counts.bootstrap);
            for (int c = 0; c < 3; ++c) sum[c] = sample.value[c];
            sum[3] = sample.covered;
            ++counts.bootstrap_samples;
        }
        if (!place.in_image) return;
        if (plan.direct_separately)
            add_direct_light(scene, plan, place, scratch.path, statistics, sum);
        film.add_sample(place.x, place.y, sum, parts);
    });

    if (plan.has_chains()) {
        counts.b = scratch.bootstrap.total() / samples;
        scratch.target.recorder.scale = counts.b;
        if (counts.b > 0)
            run_chains(scratch, plan.spread, plan.chains, plan.steps,
                       unit_key(plan.paths, 0, uint64_t(index)));
    }
    statistics.rays.closest += rays.closest + counts.bootstrap.rays.closest;
    statistics.rays.shadow += rays.shadow + counts.bootstrap.rays.shadow;
    statistics.non_finite += counts.bootstrap.non_finite + counts.chains.non_finite +
                             scratch.target.non_finite() - non_finite;
}

}  // namespace usdmlt
