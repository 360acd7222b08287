// Caustic perturbation (Veach 1997, §11.3.3): part (L|D) S* D (D|E). The direction x_m → x_{m+1}
// moves by an angle θ, the Dirac chain is traced again from the light's side, and its end x_n is
// connected to the lens, or to the next non-Dirac vertex. All such (m, n) of a path are chosen
// alike.
//
// θ is log-uniform between θ_min and θ_max, which correspond to r_min and r_max pixels in the
// image:
//     θ = r · pixel angle · |x_n … x_k| / |x_m … x_n|,
// so T uses the range of the path that is left, and what its own range could not return to is
// rejected. From a light at infinity the ray's origin moves on the plane across the direction, by
// r · pixel angle · |x_n … x_k|; half the time the direction moves as well, unless it is Dirac.
#pragma once

#include "mutations/walk.hpp"

namespace usdmlt {

// `glossy`: walks that pass near-specular vertices, and no others.
template <bool glossy>
struct CausticWalk {
    static constexpr bool by_class = !glossy;

    static bool applies(const MutationContext&, const Path& x);
    static int count_starts(const Path& x);
    static bool propose(MutationContext& context, const Path& x, Path& y, Change& change);
    static ScaledDouble density(MutationContext& context, const Path& x, const Path& y,
                                const Change& change) {
        return density(context, x, y, change, x);
    }
    // The same with the range of another path than x, whose own is the right one.
    static ScaledDouble density(MutationContext& context, const Path& x, const Path& y,
                                const Change& change, const Path& range_of);
};

struct CausticPerturbation : CausticWalk<false> {
    static constexpr const char* name = "caustic";
};

}  // namespace usdmlt
