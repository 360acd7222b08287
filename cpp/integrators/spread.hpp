// Starts of chains that are drawn many times, because the bootstrap found their light once where it
// should have done so often, are spread before chains leave from them.
//
// With v(x) = f*/(q p), see Split, the paths of a band B_j = {x: v(x) ∈ [β^j, β^{j+1}) · mean
// weight of a start} are moved by the chains' own mutations, those that leave the band being
// rejected: steps that leave f* on B_j unchanged. Starts of x ∈ B_j stay so for some of τ_j steps,
// n of them for (i + u) τ_j / n, i = 0 … n − 1. Bands and τ_j are functions of the path alone, so
// that starts are fair after any number of steps: what goes on only from heavy starts, and may
// leave the band, would take their light away.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace usdmlt {

struct Spread {
    double mean_weight = std::numeric_limits<double>::infinity();  // of starts; ∞: none are spread

    // 0: not spread.
    int band(double weight) const {
        return weight > factor * mean_weight
                   ? std::min(static_cast<int>(std::log(weight / mean_weight) / std::log(factor)),
                              most)
                   : 0;
    }
    // Steps after which number i of n starts of one path is taken.
    int64_t steps(int band, int i, int n, double u) const {
        if (band == 0) return 0;
        const double horizon = steps_per_start * std::pow(factor, band + 0.5);
        return static_cast<int64_t>((i + u) / n * horizon);
    }

private:
    static constexpr double factor = 16, steps_per_start = 64;
    static constexpr int most = 2;  // as long as all chains of a unit
};

}  // namespace usdmlt
