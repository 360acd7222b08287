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

// What perturbations that start at the lens differ in: walks without inner chains, those with, at
// whose start the direction is perturbed as well, or those that pass near-specular vertices.
enum class LensWalkKind { plain, inner_chains, glossy, aimed };

template <LensWalkKind kind>
struct LensWalk {
    // Whether it applies hangs on Dirac components and the kind of light alone.
    static constexpr bool is_glossy = kind == LensWalkKind::glossy || kind == LensWalkKind::aimed;
    static constexpr bool by_class = !is_glossy;

    static Walk walk_of(const Path& x) {
        Walk walk = find_walk(x, is_glossy);
        walk.aimed = kind == LensWalkKind::aimed;
        return walk;
    }
    static bool applies(const MutationContext&, const Path& x) {
        if (kind == LensWalkKind::glossy && !has_near_specular(x)) return false;
        const Walk walk = walk_of(x);
        if (kind == LensWalkKind::glossy) return walk.found() && walk.half_vectors > 0;
        if (kind == LensWalkKind::aimed) return walk.found() && walk.chains > 0;
        return walk.found() && (walk.chains > 0) == (kind == LensWalkKind::inner_chains);
    }
    static bool propose(MutationContext& context, const Path& x, Path& y, Change& change);
    static ScaledDouble density(MutationContext& context, const Path& x, const Path& y,
                                const Change& change);
};

struct LensPerturbation : LensWalk<LensWalkKind::plain> {
    static constexpr const char* name = "lens";
};

}  // namespace usdmlt
