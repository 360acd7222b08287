// What chains report: of one unit, and of all finished ones.
#pragma once

#include <map>
#include <mutex>

#include "integrators/chain.hpp"
#include "integrators/path_classes.hpp"
#include "integrators/statistics.hpp"
#include "mutations/mutations.hpp"

namespace usdmlt {

struct MetropolisUnitStatistics {
    ChainCounts chains{mutation_count};
    PathClasses classes;
    double b = 0;
    uint64_t bootstrap_samples = 0;
    UnitStatistics bootstrap;  // its rays

    explicit MetropolisUnitStatistics(int depth) : bootstrap(depth) {}
    void reset() {
        chains.reset();
        classes.reset();
        bootstrap.reset();
        b = 0;
        bootstrap_samples = 0;
    }
};

// Sums of integers, so that they are free of order.
class MetropolisStatistics {
public:
    void add(const MetropolisUnitStatistics& unit, double scale) {
        const std::lock_guard lock(mutex_);
        ++units;
        chains.add(unit.chains);
        bootstrap_samples += unit.bootstrap_samples;
        bootstrap_rays += unit.bootstrap.rays.closest + unit.bootstrap.rays.shadow;
        b_ += std::llrint(unit.b * scale);
        const double coarse = unit.b * scale / coarse_unit;
        b_squares_ += std::llrint(std::min(coarse * coarse, 0x1p60));
        unit.classes.for_each(
            [&](uint64_t key, double energy) { energy_[key] += std::llrint(energy * scale); });
    }

    // As integers, to be stored and added again. `sums`: of all chains, and five of each mutation.
    struct Saved {
        std::vector<int64_t> sums;
        uint64_t longest_rejection = 0;
        std::vector<std::pair<uint64_t, int64_t>> energy;  // by class of path
    };
    Saved saved() const {
        Saved out{{int64_t(units), int64_t(bootstrap_samples), int64_t(bootstrap_rays), b_,
                   b_squares_, int64_t(chains.steps), int64_t(chains.non_finite)},
                  chains.longest_rejection,
                  {energy_.begin(), energy_.end()}};
        for (const MutationCounts& m : chains.mutations)
            for (const uint64_t n : {m.applicable, m.proposed, m.made, m.accepted, m.acceptance})
                out.sums.push_back(int64_t(n));
        return out;
    }
    bool add(const Saved& saved) {
        if (saved.sums.size() != 7 + 5 * chains.mutations.size()) return false;
        const int64_t* n = saved.sums.data();
        units += uint64_t(n[0]);
        bootstrap_samples += uint64_t(n[1]);
        bootstrap_rays += uint64_t(n[2]);
        b_ += n[3];
        b_squares_ += n[4];
        ChainCounts other(static_cast<int>(chains.mutations.size()));
        other.steps = uint64_t(n[5]);
        other.non_finite = uint64_t(n[6]);
        other.longest_rejection = saved.longest_rejection;
        n += 7;
        for (MutationCounts& m : other.mutations) {
            m = {uint64_t(n[0]), uint64_t(n[1]), uint64_t(n[2]), uint64_t(n[3]), uint64_t(n[4])};
            n += 5;
        }
        chains.add(other);
        for (const auto& [key, energy] : saved.energy) energy_[key] += energy;
        return true;
    }
    void clear() {
        units = bootstrap_samples = bootstrap_rays = 0;
        b_ = b_squares_ = 0;
        chains.reset();
        energy_.clear();
    }

    // b, its standard error from the spread between units, and the relative spread of one unit.
    double b(double scale) const { return units > 0 ? double(b_) / scale / double(units) : 0; }
    double b_error(double scale) const {
        if (units < 2) return 0;
        const double n = double(units), mean = double(b_) / n / coarse_unit;
        const double variance = std::max(double(b_squares_) / n - mean * mean, 0.0) / (n - 1);
        return std::sqrt(variance) * coarse_unit / scale;
    }
    // Mean luminance of the image by class of path. Units that found no light count as any other:
    // they made no step, but they are in the picture's mean.
    std::map<uint64_t, double> energy(double scale, int64_t mutations_per_unit) const {
        std::map<uint64_t, double> out;
        for (const auto& [key, sum] : energy_)
            out[key] = double(sum) / scale / (double(units) * double(mutations_per_unit));
        return out;
    }

    uint64_t units = 0, bootstrap_samples = 0, bootstrap_rays = 0;
    ChainCounts chains{mutation_count};

private:
    static constexpr double coarse_unit = 0x1p16;
    std::mutex mutex_;
    int64_t b_ = 0, b_squares_ = 0;
    std::map<uint64_t, int64_t> energy_;
};

}  // namespace usdmlt
