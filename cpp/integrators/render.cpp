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

// Memory of one rendering thread.
struct ThreadState {
    PathTracerScratch path;
    BidirectionalScratch bidirectional;
    UnitStatistics statistics;
    double cpu_seconds = 0;

    explicit ThreadState(int depth) : bidirectional(depth), statistics(depth) {}
};

}  // namespace

Render::Render(std::shared_ptr<const Scene> scene, const Settings& settings)
    : scene_(std::move(scene)),
      settings_(settings),
      tiles_(scene_->camera.width, scene_->camera.height),
      film_(scene_->camera.width, scene_->camera.height, film_scale(*scene_, settings),
            settings.integrator == IntegratorKind::bidirectional),
      statistics_(settings.depth) {}

int64_t Render::run(int64_t last, const RunLimits& limits) {
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::unique_ptr<ThreadState>> threads(static_cast<size_t>(limits.threads));
    done_ = run_units(done_, last, limits, [&](int64_t index, int thread) {
        auto& state = threads[static_cast<size_t>(thread)];
        if (!state) state = std::make_unique<ThreadState>(settings_.depth);
        const double cpu = thread_cpu_seconds();
        UnitStatistics& unit = state->statistics;
        unit.reset();
        if (settings_.integrator == IntegratorKind::path)
            render_path_unit(*scene_, settings_, tiles_, index, state->path, film_, unit);
        else
            render_bidirectional_unit(*scene_, settings_, tiles_, index, state->bidirectional,
                                      film_, unit);
        statistics_.add(unit, film_.scale());
        state->cpu_seconds += thread_cpu_seconds() - cpu;
    });
    for (const auto& state : threads)
        if (state) cpu_seconds_ += state->cpu_seconds;
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return done_;
}

}  // namespace usdmlt
