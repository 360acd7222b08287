// Lens perturbation (Veach 1997, §11.3.3): the image position moves by r, log-uniform between
// r_min and r_max, the walk from the eye is traced again through the same Dirac chain, and its end
// is connected to the old next vertex: suffix (L|D) D S* E; or it lands on a light: L S* E.
//
// Of a camera with an aperture the lens point is kept or, half the time, moved as well: by a
// log-uniform distance on the lens. Raster densities are converted by the camera's density of
// directions (of origins, for an orthographic one).
#pragma once

#include "mutations/walk.hpp"

namespace usdmlt {

// What lens and multi-chain perturbations share: the walk from the lens, which has inner chains, at
// whose start the direction is perturbed as well, or none.
template <bool inner_chains>
struct LensWalk {
    static bool applies(const MutationContext&, const Path& x) {
        const Walk walk = find_walk(x, Known::eye, x.edges());
        return walk.found() && (walk.chains > 0) == inner_chains;
    }
    static bool propose(MutationContext& context, const Path& x, Path& y, Change& change);
    static ScaledDouble density(const MutationContext& context, const Path& x, const Path& y,
                                const Change& change);
};

struct LensPerturbation : LensWalk<false> {
    static constexpr const char* name = "lens";
};

}  // namespace usdmlt
