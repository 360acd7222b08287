// A render: a plan, numbered units, and the film that sums them.
#pragma once

#include <memory>

#include "integrators/bidirectional.hpp"
#include "integrators/path_tracer.hpp"
#include "integrators/scheduler.hpp"

namespace usdmlt {

class Render {
public:
    // Makes the plan: the film's scale comes from a short pilot of camera samples, counted, that
    // deposits nothing.
    Render(std::shared_ptr<const Scene> scene, const Settings& settings);

    const Scene& scene() const { return *scene_; }
    const Settings& settings() const { return settings_; }
    const Film& film() const { return film_; }
    const Statistics& statistics() const { return statistics_; }

    int64_t units_total() const { return tiles_.count() * settings_.samples; }
    int64_t units_done() const { return done_; }
    double seconds() const { return seconds_; }
    double cpu_seconds() const { return cpu_seconds_; }

    // Renders units units_done … last − 1, or fewer where a limit stops them. Returns units_done.
    int64_t run(int64_t last, const RunLimits& limits);

    // The first `count` rays of the render, in order; leaves the render as it is.
    RayRecorder record_rays(size_t count) const;

private:
    std::shared_ptr<const Scene> scene_;
    Settings settings_;
    Tiles tiles_;
    Film film_;
    Statistics statistics_;
    int64_t done_ = 0;
    double seconds_ = 0, cpu_seconds_ = 0;
};

// Seconds of processor time that the acceleration structure alone takes for the rays.
double replay_rays(const Scene& scene, const RayRecorder& rays);

}  // namespace usdmlt
