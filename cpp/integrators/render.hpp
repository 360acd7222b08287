// A render: a plan, numbered units, and the film that sums them.
#pragma once

#include <memory>

#include "film/development.hpp"
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
    Film& film() { return film_; }
    const Statistics& statistics() const { return statistics_; }
    // A number that tells plans apart: also those of machines on which pilots give other bits.
    uint64_t plan_digest() const;

    // Of Metropolis light transport, else null.
    const MetropolisPlan* metropolis() const { return metropolis_.get(); }
    const MetropolisStatistics& metropolis_statistics() const { return metropolis_statistics_; }

    int64_t units_total() const;
    const UnitSet& units() const { return done_; }
    int64_t units_done() const { return done_.count(); }
    const Development& development() const { return development_; }
    // RGBA and standard error of the luminance, by pixel; see Film.
    void develop(float* rgba) const;
    void develop_error(float* error) const;
    void develop_layer(int layer, float* rgb) const;
    double seconds() const { return seconds_; }
    double cpu_seconds() const { return cpu_seconds_; }

    // Renders units first … last − 1, none of which is done, or fewer where a limit stops them:
    // returns n, for first … n − 1.
    int64_t run(int64_t first, int64_t last, const RunLimits& limits);

    // What units of the same plan gave elsewhere, but for the film's sums.
    struct Saved {
        std::vector<UnitSet::Range> units;
        std::vector<int64_t> statistics;
        MetropolisStatistics::Saved metropolis;
        uint64_t overflows = 0;
        double seconds = 0, cpu_seconds = 0;
    };
    Saved saved() const;
    // Throws where it is of another plan, or where units are done already.
    void add(const Saved& saved);
    // Back to the plan: nothing is done.
    void clear();

    // The first `count` rays of the render, in order; leaves the render as it is.
    RayRecorder record_rays(size_t count) const;

private:
    std::shared_ptr<const Scene> scene_;
    Settings settings_;
    Tiles tiles_;
    std::unique_ptr<const MetropolisPlan> metropolis_;
    double pilot_mean_;  // of the pilot that gave the film its scale
    Film film_;
    Development development_;
    Statistics statistics_;
    MetropolisStatistics metropolis_statistics_;
    UnitSet done_;
    double seconds_ = 0, cpu_seconds_ = 0;
};

// Seconds of processor time that the acceleration structure alone takes for the rays.
double replay_rays(const Scene& scene, const RayRecorder& rays);

}  // namespace usdmlt
