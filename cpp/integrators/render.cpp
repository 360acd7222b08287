#include "integrators/render.hpp"

#include <bit>
#include <chrono>
#include <ctime>
#include <stdexcept>

#include "base/floating_point.hpp"

namespace usdmlt {
namespace {

// Of the radiance of some camera samples.
double mean_radiance(const Scene& scene, const Settings& settings) {
    constexpr int pilot_samples = 4096;
    const FlushDenormals flush;
    PathTracerScratch scratch;
    UnitStatistics statistics(settings.depth);
    double sum = 0;
    Settings pilot = settings;
    pilot.min_edges = 1;
    for (uint32_t i = 0; i < pilot_samples; ++i) {
        Sampler sampler(hash_key(settings.seed, ~uint64_t(0)), i, 16);
        const Vec2f u = sampler.next_2d();
        float alpha;
        const Spectrum value =
            trace_path(scene, pilot, sampler, {u.x * scene.camera.width, u.y * scene.camera.height},
                       scratch, statistics, alpha);
        sum += max_component(value);
    }
    return sum / pilot_samples;
}

// The film's fixed-point scale: a power of two that puts the mean radiance of camera samples near
// 2^26, which leaves 2^36 such samples of headroom and a resolution of 1e-8 of the mean.
double film_scale(double mean) {
    return mean > 1e-30 ? std::exp2(std::clamp(26 - std::ceil(std::log2(mean)), -60.0, 60.0))
                        : 0x1p26;
}

double thread_cpu_seconds() {
#ifdef CLOCK_THREAD_CPUTIME_ID
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
#else
    return double(std::clock()) / CLOCKS_PER_SEC;
#endif
}

// Before anything is planned, so that all parts of a render go by the same.
Settings resolve(const Scene& scene, Settings settings) {
    settings.background = settings.background && scene.background;
    return settings;
}

std::unique_ptr<const MetropolisPlan> again(const MetropolisPlan* plan, uint64_t seed,
                                            int samples) {
    if (!plan) return nullptr;
    auto copy = std::make_unique<MetropolisPlan>(*plan);
    copy->paths.seed = copy->direct.seed = seed;
    copy->shorten(samples);
    return copy;
}

double sample_weight(const MetropolisPlan* plan) { return plan ? plan->mutations_per_sample() : 1; }

Development development_of(const MetropolisPlan* plan, const Scene& scene) {
    return {plan ? plan->mutations_per_unit() : 0, scene.exposure};
}

// Memory of one rendering thread.
struct ThreadState {
    PathTracerScratch path;
    std::unique_ptr<StrategyScratch> bidirectional;
    std::unique_ptr<MetropolisScratch> metropolis;
    std::unique_ptr<LayerScratch> layers;
    UnitSplats splats;
    UnitStatistics statistics;
    double cpu_seconds = 0;

    ThreadState(const Scene& scene, const Settings& settings, const MetropolisPlan* plan)
        : splats(scene.camera.width / settings.reduction), statistics(settings.depth) {
        if (settings.integrator == IntegratorKind::bidirectional)
            bidirectional = std::make_unique<StrategyScratch>(settings.depth);
        if (plan) metropolis = std::make_unique<MetropolisScratch>(scene, *plan);
        if (!settings.layers) return;
        layers = std::make_unique<LayerScratch>(
            LayerScratch{LightPathClasses(scene, *settings.layers), {}, {}});
        path.layers = layers.get();
        if (plan) metropolis->layers = layers.get();
    }
};

void render_unit(const Scene& scene, const Settings& settings, const MetropolisPlan* plan,
                 const Tiles& tiles, int64_t index, ThreadState& thread, Film& film) {
    switch (settings.integrator) {
        case IntegratorKind::path:
            render_path_unit(scene, settings, tiles, index, thread.path, film, thread.statistics);
            break;
        case IntegratorKind::bidirectional:
            render_bidirectional_unit(scene, settings, tiles, index, *thread.bidirectional,
                                      thread.layers.get(), film, thread.splats, thread.statistics);
            break;
        case IntegratorKind::metropolis:
            render_metropolis_unit(scene, *plan, index, *thread.metropolis, film, thread.splats,
                                   thread.statistics);
            break;
    }
    film.add_splats(thread.splats);
}

}  // namespace

Render::Render(std::shared_ptr<const Scene> scene, const Settings& settings)
    : scene_(std::move(scene)),
      settings_(resolve(*scene_, settings)),
      tiles_(scene_->camera.width / settings_.reduction,
             scene_->camera.height / settings_.reduction),
      metropolis_(settings_.integrator == IntegratorKind::metropolis
                      ? std::make_unique<MetropolisPlan>(*scene_, settings_)
                      : nullptr),
      pilot_mean_(mean_radiance(*scene_, settings_)),
      film_(tiles_.width, tiles_.height, film_scale(pilot_mean_), sample_weight(metropolis_.get()),
            settings_.integrator != IntegratorKind::path, settings_.error_layer,
            settings_.layers ? settings_.layers->layers : 0),
      development_(development_of(metropolis_.get(), *scene_)),
      statistics_(settings_.depth) {}

Render::Render(const Render& other, uint64_t seed, int samples)
    : scene_(other.scene_),
      settings_(other.settings_),
      tiles_(other.tiles_),
      metropolis_(again(other.metropolis_.get(), seed, samples)),
      pilot_mean_(other.pilot_mean_),
      film_(tiles_.width, tiles_.height, other.film_.scale(), sample_weight(metropolis_.get()),
            other.film_.has_splats(), false),
      development_(development_of(metropolis_.get(), *scene_)),
      statistics_(settings_.depth) {
    settings_.seed = seed;
    settings_.samples = samples;
    settings_.error_layer = false;
    settings_.layers = nullptr;
}

int64_t Render::units_total() const {
    if (!metropolis_) return tiles_.count() * settings_.samples;
    const int64_t pixels = int64_t(film_.width()) * film_.height();
    // Enough for one camera sample of every pixel, at least.
    return std::max(
        static_cast<int64_t>(std::ceil(double(pixels) * settings_.samples / metropolis_->work)),
        metropolis_->pixels.units_per_pass());
}

void Render::develop(float* rgba) const { development_.picture(film_, done_, rgba); }

void Render::develop_layer(int layer, float* rgb) const {
    development_.layer(film_, done_, layer, rgb);
}

void Render::develop_error(float* error) const { development_.error(film_, done_, error); }

uint64_t Render::plan_digest() const {
    uint64_t key = hash_key(std::bit_cast<uint64_t>(pilot_mean_), uint64_t(settings_.integrator));
    if (metropolis_) key = hash_key(key, metropolis_->digest());
    return key;
}

Render::Saved Render::saved() const {
    Saved saved{done_.ranges(), statistics_.saved(), {}, film_.overflows(), seconds_, cpu_seconds_};
    if (metropolis_) saved.metropolis = metropolis_statistics_.saved();
    return saved;
}

void Render::add(const Saved& saved) {
    UnitSet done = done_;
    for (const UnitSet::Range& range : saved.units) {
        if (range.first < 0 || range.first >= range.second)
            throw std::invalid_argument("no range of units");
        if (done.overlaps(range)) throw std::invalid_argument("units are done already");
        done.add(range);
    }
    if (!statistics_.add(saved.statistics) ||
        (metropolis_ && !metropolis_statistics_.add(saved.metropolis)))
        throw std::invalid_argument("statistics of another plan");
    done_ = done;
    film_.add_overflows(saved.overflows);
    seconds_ += saved.seconds;
    cpu_seconds_ += saved.cpu_seconds;
}

void Render::clear() {
    film_.clear();
    statistics_.clear();
    metropolis_statistics_.clear();
    done_ = {};
    seconds_ = cpu_seconds_ = 0;
}

int64_t Render::run(int64_t first, int64_t last, const RunLimits& limits) {
    if (done_.overlaps({first, last})) throw std::invalid_argument("units are done already");
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::unique_ptr<ThreadState>> threads(static_cast<size_t>(limits.threads));
    const auto unit = [&](int64_t index, int thread) {
        auto& state = threads[static_cast<size_t>(thread)];
        if (!state) state = std::make_unique<ThreadState>(*scene_, settings_, metropolis_.get());
        const double cpu = thread_cpu_seconds();
        state->statistics.reset();
        render_unit(*scene_, settings_, metropolis_.get(), tiles_, index, *state, film_);
        statistics_.add(state->statistics, film_.scale());
        if (state->metropolis)
            metropolis_statistics_.add(state->metropolis->statistics, film_.scale());
        state->cpu_seconds += thread_cpu_seconds() - cpu;
    };
    int64_t end = first;
    try {
        end = run_units(first, last, limits, unit);
    } catch (...) {
        clear();  // the film has some of units that are not done
        throw;
    }
    for (const auto& state : threads)
        if (state) cpu_seconds_ += state->cpu_seconds;
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    done_.add({first, end});
    return end;
}

RayRecorder Render::record_rays(size_t count) const {
    const FlushDenormals flush;
    Settings settings = settings_;
    settings.layers = nullptr;
    settings.error_layer = false;
    ThreadState state(*scene_, settings, metropolis_.get());
    Film film(film_.width(), film_.height(), film_.scale(), film_.sample_weight(),
              film_.has_splats(), false);
    RayRecorder recorder;
    state.statistics.rays.recorder = &recorder;
    for (int64_t i = 0; i < units_total() && recorder.entries.size() < count; ++i)
        render_unit(*scene_, settings_, metropolis_.get(), tiles_, i, state, film);
    if (recorder.entries.size() > count) recorder.entries.resize(count);
    return recorder;
}

double replay_rays(const Scene& scene, const RayRecorder& rays) {
    const FlushDenormals flush;
    const double start = thread_cpu_seconds();
    Hit hit;
    for (const RayRecorder::Entry& entry : rays.entries) {
        if (entry.shadow)
            scene.acceleration->occluded(entry.ray);
        else
            scene.acceleration->intersect(entry.ray, hit);
    }
    return thread_cpu_seconds() - start;
}

}  // namespace usdmlt
