// The Metropolis algorithm: the one place of selection, acceptance, expected values and counts.
//
// From state x a mutation m is selected among those that apply, with P(m | x) ∝ its weight, and
// proposes y:
//     a(x→y) = min(1, f*(y) P(m | y) T_m(y→x) / (f*(x) P(m | x) T_m(x→y))).
// Every step records x with weight 1 − a and y with weight a (Veach 1997, §11.2.4); what fails to
// make a y is a rejection, a = 0.
//
// A target provides
//     State;  uint32_t applicable(x)     bit m: mutation m applies
//     bool propose(m, x, y)              y with f*(y), or failure
//     double ratio(m, x, y)              f*(y) T(y→x) / (f*(x) T(x→y)), selection left out
//     void deposit(state, weight)        once for every state, with all its weight
//     void accept(x, y), reject(y)       y becomes x, or is thrown away
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/rng.hpp"

namespace usdmlt {

// P(m | set of mutations that apply).
class MutationSelection {
public:
    explicit MutationSelection(const std::vector<double>& weights) : weights_(weights) {
        totals_.resize(size_t(1) << weights.size());
        for (size_t mask = 0; mask < totals_.size(); ++mask)
            for (size_t m = 0; m < weights.size(); ++m)
                if (mask >> m & 1) totals_[mask] += weights[m];
    }
    int count() const { return static_cast<int>(weights_.size()); }
    double probability(int m, uint32_t mask) const {
        return mask >> m & 1 ? weights_[static_cast<size_t>(m)] / totals_[mask] : 0;
    }
    // −1 where none applies.
    int sample(uint32_t mask, double u) const {
        u *= totals_[mask];
        int last = -1;
        for (int m = 0; m < count(); ++m) {
            const double w = weights_[static_cast<size_t>(m)];
            if (!(mask >> m & 1) || w == 0) continue;
            last = m;
            if ((u -= w) < 0) break;
        }
        return last;
    }

private:
    std::vector<double> weights_, totals_;
};

// Counts of one mutation; acceptances are sums of 2^20 ths, so that totals are free of order.
struct MutationCounts {
    static constexpr double unit = 0x1p20;
    uint64_t applicable = 0;  // steps at which it could have been selected
    uint64_t proposed = 0;    // steps at which it was
    uint64_t made = 0;        // that made a y with f*(y) > 0
    uint64_t accepted = 0;
    uint64_t acceptance = 0;  // Σ a

    void add(const MutationCounts& other) {
        applicable += other.applicable;
        proposed += other.proposed;
        made += other.made;
        accepted += other.accepted;
        acceptance += other.acceptance;
    }
};

struct ChainCounts {
    std::vector<MutationCounts> mutations;
    std::vector<uint64_t> masks;  // steps by set of mutations that apply
    uint64_t steps = 0;
    uint64_t longest_rejection = 0;
    uint64_t non_finite = 0;

    explicit ChainCounts(int count)
        : mutations(static_cast<size_t>(count)), masks(size_t(1) << count) {}
    void reset() { *this = ChainCounts(static_cast<int>(mutations.size())); }
    // Moves the counts by set into those by mutation.
    void finish() {
        for (size_t mask = 0; mask < masks.size(); ++mask) {
            for (size_t m = 0; m < mutations.size(); ++m)
                if (mask >> m & 1) mutations[m].applicable += masks[mask];
            masks[mask] = 0;
        }
    }
    void add(const ChainCounts& other) {
        for (size_t m = 0; m < mutations.size(); ++m) mutations[m].add(other.mutations[m]);
        steps += other.steps;
        longest_rejection = std::max(longest_rejection, other.longest_rejection);
        non_finite += other.non_finite;
    }
};

// Runs `steps` steps from x, whose mutations are known; `y` is scratch. x ends as the last state.
template <typename Target>
void run_chain(Target& target, const MutationSelection& selection, typename Target::State& x,
               typename Target::State& y, int64_t steps, RandomStream& random,
               ChainCounts& counts) {
    double weight = 0;  // of x, since it was reached
    uint64_t rejections = 0;
    uint32_t mask = target.applicable(x);
    counts.steps += static_cast<uint64_t>(steps);
    for (int64_t step = 0; step < steps; ++step) {
        ++counts.masks[mask];
        const int m = selection.sample(mask, random.next_double());
        double a = 0;
        uint32_t mask_y = 0;
        if (m >= 0) {
            MutationCounts& c = counts.mutations[static_cast<size_t>(m)];
            ++c.proposed;
            if (target.propose(m, x, y)) {
                ++c.made;
                mask_y = target.applicable(y);
                const double r = target.ratio(m, x, y) * (selection.probability(m, mask_y) /
                                                          selection.probability(m, mask));
                if (std::isfinite(r))
                    a = std::clamp(r, 0.0, 1.0);
                else
                    ++counts.non_finite;
                c.acceptance += static_cast<uint64_t>(std::llrint(a * MutationCounts::unit));
                if (a > 0 && random.next_double() < a) {
                    ++c.accepted;
                    counts.longest_rejection = std::max(counts.longest_rejection, rejections);
                    rejections = 0;
                    target.deposit(x, weight + 1 - a);
                    weight = a;
                    target.accept(x, y);
                    mask = mask_y;
                    continue;
                }
                if (a > 0) target.deposit(y, a);
                target.reject(y);
            }
        }
        weight += 1 - a;
        ++rejections;
    }
    counts.longest_rejection = std::max(counts.longest_rejection, rejections);
    if (weight > 0) target.deposit(x, weight);
}

}  // namespace usdmlt
