// Discrete distributions: sampled by inverting the cumulative sum, which keeps the stratification
// of the random number.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace usdmlt {

class DiscreteDistribution {
public:
    DiscreteDistribution() = default;
    explicit DiscreteDistribution(std::span<const double> weights) {
        cumulative_.resize(weights.size() + 1, 0.0);
        for (size_t i = 0; i < weights.size(); ++i)
            cumulative_[i + 1] = cumulative_[i] + weights[i];
        total_ = cumulative_.back();
        if (total_ > 0)
            for (double& c : cumulative_) c /= total_;
    }

    bool empty() const { return !(total_ > 0); }
    size_t size() const { return cumulative_.empty() ? 0 : cumulative_.size() - 1; }
    double total() const { return total_; }
    double probability(size_t i) const { return cumulative_[i + 1] - cumulative_[i]; }

    // Index i with cumulative[i] ≤ u < cumulative[i+1], never one of weight zero; `u` becomes its
    // relative position in that interval, to be used again as a fresh uniform number.
    size_t sample(float& u, double& probability_out) const {
        const auto it = std::upper_bound(cumulative_.begin() + 1, cumulative_.end() - 1, double(u));
        size_t i = static_cast<size_t>(it - cumulative_.begin()) - 1;
        while (i > 0 && probability(i) <= 0) --i;
        probability_out = probability(i);
        u = std::clamp(static_cast<float>((u - cumulative_[i]) / probability_out), 0.0f,
                       0x1.fffffep-1f);
        return i;
    }

private:
    std::vector<double> cumulative_;
    double total_ = 0;
};

}  // namespace usdmlt
