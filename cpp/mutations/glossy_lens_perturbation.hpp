// Lens perturbation through glossy reflections: a near-specular vertex is passed with its half
// vector kept, as a Dirac one is, where the lens perturbation would connect it and turn its narrow
// lobe away: suffix (L|D) D (S|G)* E with a G at least, and all inner chains as in the multi-chain
// perturbation.
#pragma once

#include "mutations/lens_perturbation.hpp"

namespace usdmlt {

struct GlossyLensPerturbation : LensWalk<LensWalkKind::glossy> {
    static constexpr const char* name = "glossy_lens";
};

}  // namespace usdmlt
