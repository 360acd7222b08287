// Bidirectional mutation (Veach 1997, §11.3.1): delete the edges between x_l and x_m, add l'
// vertices to the light's part and m' to the eye's by ordinary sampling, and join the two:
//     T(x→y) = p_d(l, m | k) · p_a(k_a | k, l, m) · 1/n Σ_{l'+m' = k_a − 1} p(new vertices | l',
//     m'),
// n splits. Deleted edges k_d = m − l: 1, 2, n ≥ 3 with weights ¼, ½, 2^−n, the same for all (l, m)
// of one length; added edges k_a: ½ for k_d, 0.15 for k_d ± 1, 0.2·2^−j for k_d ± j, renormalised
// over those that can be drawn.
#pragma once

#include "mutations/segment.hpp"

namespace usdmlt {

struct Bidirectional {
    static constexpr const char* name = "bidirectional";
    static constexpr bool by_class = true;

    // p_d, p_a and n of a change of a path of k edges. A change that cannot be drawn has p_a = 0.
    struct Choice {
        double deletion = 0, addition = 0;
        int splits = 0;
    };
    static Choice choice(const MutationContext& context, int k, const Change& change);

    static bool applies(const MutationContext&, const Path&) { return true; }
    static bool propose(MutationContext& context, const Path& x, Path& y, Change& change);
    static ScaledDouble density(MutationContext& context, const Path& x, const Path& y,
                                const Change& change);
};

}  // namespace usdmlt
