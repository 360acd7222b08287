// A render: a plan, numbered units, and the film that sums them.
#pragma once

#include <memory>

#include "integrators/bidirectional.hpp"
#include "integrators/metropolis.hpp"
#include "integrators/path_tracer.hpp"
#include "integrators/scheduler.hpp"

namespace usdmlt {

class Render {
public:
    // Makes the plan: the film's scale and what Metropolis light transport adapts come from short
    // pilots, counted, that deposit nothing.
    Render(std::shared_ptr<const Scene> scene, const Settings& settings);

    // By the same plan, with other random numbers and without an error layer: independent of this
    // render, given the plan. With few samples the units of Metropolis light transport are shorter.
    Render(const Render& other, uint64_t seed, int samples);

    const Scene& scene() const { return *scene_; }
    const Settings& settings() const { return settings_; }
    const Film& film() const { return film_; }
    const Statistics& statistics() const { return statistics_; }

    // Of Metropolis light transport, else null.
    const MetropolisPlan* metropolis() const { return metropolis_.get(); }
    const MetropolisStatistics& metropolis_statistics() const { return metropolis_statistics_; }

    int64_t units_total() const;
    int64_t units_done() const { return done_; }
    // RGBA and standard error of the luminance, by pixel; see Film.
    void develop(float* rgba) const;
    void develop_error(float* error) const;
    void develop_layer(int layer, float* rgb) const;
    double seconds() const { return seconds_; }
    double cpu_seconds() const { return cpu_seconds_; }

    // Renders units units_done … last − 1, or fewer where a limit stops them. Returns units_done.
    int64_t run(int64_t last, const RunLimits& limits);

    // The first `count` rays of the render, in order; leaves the render as it is.
    RayRecorder record_rays(size_t count) const;

private:
    double splats_per_pixel() const;

    std::shared_ptr<const Scene> scene_;
    Settings settings_;
    Tiles tiles_;
    std::unique_ptr<const MetropolisPlan> metropolis_;
    Film film_;
    Statistics statistics_;
    MetropolisStatistics metropolis_statistics_;
    int64_t done_ = 0;
    double seconds_ = 0, cpu_seconds_ = 0;
};

// Seconds of processor time that the acceleration structure alone takes for the rays.
double replay_rays(const Scene& scene, const RayRecorder& rays);

}  // namespace usdmlt
