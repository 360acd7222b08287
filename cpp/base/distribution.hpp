// Discrete distributions: sampled by inverting the cumulative sum, which keeps the stratification
// of the random number.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/rng.hpp"

namespace usdmlt {

// A float has 24 bits: too few to choose among millions and to keep a remainder. Appends bits
// hashed from other uniform numbers of the same sample; the leading 24 stay, and with them the
// stratification.
inline double extend_uniform(float u, Vec2f others) {
    const uint64_t x = static_cast<uint32_t>(others.x * 0x1p24f);
    const uint64_t y = static_cast<uint32_t>(others.y * 0x1p24f);
    const uint64_t bits = mix64((x << 24 | y) + 0x9e3779b97f4a7c15ull) >> 36;
    return std::min((static_cast<double>(u) + static_cast<double>(bits) * 0x1p-52), 1 - 0x1p-53);
}

class DiscreteDistribution {
public:
    DiscreteDistribution() = default;
    explicit DiscreteDistribution(std::span<const double> weights) {
        cumulative_.resize(weights.size() + 1, 0.0);
        for (size_t i = 0; i < weights.size(); ++i)
            cumulative_[i + 1] = cumulative_[i] + weights[i];
        total_ = cumulative_.back();
        if (!(total_ > 0)) return;
        for (double& c : cumulative_) c /= total_;
        build_guide();
    }

    bool empty() const { return !(total_ > 0); }
    size_t size() const { return cumulative_.empty() ? 0 : cumulative_.size() - 1; }
    double total() const { return total_; }
    double probability(size_t i) const { return cumulative_[i + 1] - cumulative_[i]; }

    // Index i with cumulative[i] ≤ u < cumulative[i+1], never one of weight zero; `u` becomes its
    // relative position in that interval, to be used again as a fresh uniform number. Not to be
    // called when empty.
    size_t sample(double& u, double& probability_out) const {
        const size_t bucket =
            std::min(static_cast<size_t>(u * static_cast<double>(size())), size() - 1);
        const auto first = cumulative_.begin() + 1 + guide_[bucket];
        const auto last = cumulative_.begin() + 1 + guide_[bucket + 1];
        const size_t i =
            static_cast<size_t>(std::upper_bound(first, last, u) - first) + guide_[bucket];
        probability_out = probability(i);
        u = std::clamp((u - cumulative_[i]) / probability_out, 0.0, 1 - 0x1p-53);
        return i;
    }
    size_t sample(float& u, double& probability_out) const {
        double precise = u;
        const size_t i = sample(precise, probability_out);
        u = std::min(static_cast<float>(precise), 0x1.fffffep-1f);
        return i;
    }

private:
    // guide[k]: the index that u = k/n selects, so that a search spans one bucket (Chen & Asau
    // 1974): constant expected time instead of a walk over the whole array.
    void build_guide() {
        const size_t n = size();
        guide_.resize(n + 1);
        uint32_t i = 0;
        for (size_t k = 0; k < n; ++k) {
            while (cumulative_[i + 1] <= static_cast<double>(k) / static_cast<double>(n)) ++i;
            guide_[k] = i;
        }
        while (i + 1 < n && cumulative_[i + 1] < 1) ++i;
        guide_[n] = i;
    }

    std::vector<double> cumulative_;
    std::vector<uint32_t> guide_;
    double total_ = 0;
};

}  // namespace usdmlt
