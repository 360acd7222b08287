#include "integrators/render.hpp"

#include <chrono>
#include <ctime>

#include "base/floating_point.hpp"

namespace usdmlt {
namespace {

// The film's fixed-point scale: a power of two that puts the mean radiance of camera samples near
// 2^26, which leaves 2^36 such samples of headroom and a resolution of 1e-8 of the mean.
double film_scale(const Scene& scene, const Settings& settings) {
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
    const double mean = sum / pilot_samples;
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

// Memory of one rendering thread.
struct ThreadState {
    PathTracerScratch path;
    std::unique_ptr<StrategyScratch> bidirectional;
    std::unique_ptr<MetropolisScratch> metropolis;
    std::unique_ptr<LayerScratch> layers;
    UnitStatistics statistics;
    double cpu_seconds = 0;

    ThreadState(const Scene& scene, const Settings& settings, const MetropolisPlan* plan)
        : statistics(settings.depth) {
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
            return render_path_unit(scene, settings, tiles, index, thread.path, film,
                                    thread.statistics);
        case IntegratorKind::bidirectional:
            return render_bidirectional_unit(scene, settings, tiles, index, *thread.bidirectional,
                                             thread.layers.get(), film, thread.statistics);
        case IntegratorKind::metropolis:
            return render_metropolis_unit(scene, *plan, index, *thread.metropolis, film,
                                          thread.statistics);
    }
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
      film_(tiles_.width, tiles_.height, film_scale(*scene_, settings_),
            settings_.integrator != IntegratorKind::path, settings_.error_layer,
            settings_.layers ? settings_.layers->layers : 0),
      statistics_(settings_.depth) {}

Render::Render(const Render& other, uint64_t seed, int samples)
    : scene_(other.scene_),
      settings_(other.settings_),
      tiles_(other.tiles_),
      metropolis_(again(other.metropolis_.get(), seed, samples)),
      film_(tiles_.width, tiles_.height, other.film_.scale(), other.film_.has_splats(), false),
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

double Render::splats_per_pixel() const {
    const double pixels = double(film_.width()) * film_.height();
    return metropolis_ ? double(done_) * double(metropolis_->mutations_per_unit()) / pixels
                       : double(film_.sample_count()) / pixels;
}

void Render::develop(float* rgba) const {
    film_.develop(rgba, splats_per_pixel(), scene_->exposure);
}

void Render::develop_layer(int layer, float* rgb) const {
    film_.develop_layer(layer, rgb, splats_per_pixel(), scene_->exposure);
}

void Render::develop_error(float* error) const {
    // Units, or for tiles passes, go to the batches in turn.
    double share[Film::batches] = {};
    const int64_t in_turn = metropolis_ ? 1 : tiles_.count();
    for (int b = 0; b < Film::batches; ++b) {
        const int64_t cycle = Film::batches * in_turn, rest = done_ % cycle - b * in_turn;
        const int64_t units = done_ / cycle * in_turn + std::clamp(rest, int64_t(0), in_turn);
        share[b] = done_ > 0 ? double(units) / double(done_) : 0;
    }
    film_.develop_error(error, splats_per_pixel(), share, scene_->exposure);
}

int64_t Render::run(int64_t last, const RunLimits& limits) {
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::unique_ptr<ThreadState>> threads(static_cast<size_t>(limits.threads));
    done_ = run_units(done_, last, limits, [&](int64_t index, int thread) {
        auto& state = threads[static_cast<size_t>(thread)];
        if (!state) state = std::make_unique<ThreadState>(*scene_, settings_, metropolis_.get());
        const double cpu = thread_cpu_seconds();
        state->statistics.reset();
        render_unit(*scene_, settings_, metropolis_.get(), tiles_, index, *state, film_);
        statistics_.add(state->statistics, film_.scale());
        if (state->metropolis)
            metropolis_statistics_.add(state->metropolis->statistics, film_.scale());
        state->cpu_seconds += thread_cpu_seconds() - cpu;
    });
    for (const auto& state : threads)
        if (state) cpu_seconds_ += state->cpu_seconds;
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return done_;
}

RayRecorder Render::record_rays(size_t count) const {
    const FlushDenormals flush;
    Settings settings = settings_;
    settings.layers = nullptr;
    ThreadState state(*scene_, settings, metropolis_.get());
    Film film(film_.width(), film_.height(), film_.scale(), film_.has_splats(), false);
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
