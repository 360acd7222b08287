// New path: y does not depend on x. Choose the length k and the strategy s with probability
// P(k, s), and make one path:
//     T(y) = Σ_s P(k, s) p_{s,k+1−s}(y).
#pragma once

#include "mutations/segment.hpp"

namespace usdmlt {

struct NewPath {
    static constexpr const char* name = "new_path";
    static constexpr bool by_class = true;

    static bool applies(const MutationContext&, const Path&) { return true; }

    static bool propose(MutationContext& context, const Path& x, Path& y, Change& change) {
        int k, s;
        if (!context.strategies.sample(context.random.next_double(), k, s)) return false;
        change = {-1, x.edges() + 1, 0, -1};
        if (!make_segment(context, x, change, s, k + 1 - s, y)) return false;
        context.recorded *= context.strategies.probability(k, s);
        return true;
    }

    static ScaledDouble density(MutationContext& context, const Path&, const Path& y,
                                const Change&) {
        const int k = y.edges();
        return sum_over_splits(context, y, -1, k + 1,
                               [&](int s) { return context.strategies.probability(k, s); });
    }
};

}  // namespace usdmlt
