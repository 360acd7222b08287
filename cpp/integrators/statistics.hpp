// Counts and energies of a render: integers, so that they too are free of order.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/spectrum.hpp"
#include "paths/trace.hpp"

namespace usdmlt {

// Of one unit; local to its thread.
struct UnitStatistics {
    RayCounters rays;
    uint64_t samples = 0;
    uint64_t non_finite = 0;
    std::vector<double> energy;  // luminance by edges of the path

    explicit UnitStatistics(int depth) : energy(static_cast<size_t>(depth) + 1, 0.0) {}
    void reset() {
        rays.closest = rays.shadow = 0;
        samples = non_finite = 0;
        std::fill(energy.begin(), energy.end(), 0.0);
    }
};

// Of all finished units.
class Statistics {
public:
    explicit Statistics(int depth) : energy_(static_cast<size_t>(depth) + 1) {}

    void add(const UnitStatistics& unit, double scale) {
        closest_ += unit.rays.closest;
        shadow_ += unit.rays.shadow;
        samples_ += unit.samples;
        non_finite_ += unit.non_finite;
        for (size_t k = 0; k < energy_.size(); ++k)
            energy_[k] += static_cast<int64_t>(std::llrint(unit.energy[k] * scale));
    }
    // As integers, to be stored and added again to statistics of the same depth.
    std::vector<int64_t> saved() const {
        std::vector<int64_t> out{int64_t(closest_), int64_t(shadow_), int64_t(samples_),
                                 int64_t(non_finite_)};
        for (const auto& e : energy_) out.push_back(e);
        return out;
    }
    bool add(const std::vector<int64_t>& saved) {
        if (saved.size() != 4 + energy_.size()) return false;
        closest_ += uint64_t(saved[0]);
        shadow_ += uint64_t(saved[1]);
        samples_ += uint64_t(saved[2]);
        non_finite_ += uint64_t(saved[3]);
        for (size_t k = 0; k < energy_.size(); ++k) energy_[k] += saved[4 + k];
        return true;
    }
    void clear() {
        closest_ = shadow_ = samples_ = non_finite_ = 0;
        for (auto& e : energy_) e = 0;
    }
    uint64_t closest() const { return closest_; }
    uint64_t shadow() const { return shadow_; }
    uint64_t samples() const { return samples_; }  // of the camera
    uint64_t non_finite() const { return non_finite_; }
    // Mean luminance of the image by path length.
    std::vector<double> energy(double scale) const {
        std::vector<double> out;
        for (const auto& e : energy_)
            out.push_back(samples_ > 0 ? double(e.load()) / scale / double(samples_) : 0);
        return out;
    }

private:
    std::atomic<uint64_t> closest_{0}, shadow_{0}, samples_{0}, non_finite_{0};
    std::vector<std::atomic<int64_t>> energy_;
};

}  // namespace usdmlt
