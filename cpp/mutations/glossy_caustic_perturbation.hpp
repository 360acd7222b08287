// Caustic perturbation through glossy reflections: part (L|D) (S|G)* D (D|E) with a G at least, the
// near-specular vertices of which keep their half vectors.
#pragma once

#include "mutations/caustic_perturbation.hpp"

namespace usdmlt {

struct GlossyCausticPerturbation : CausticWalk<true> {
    static constexpr const char* name = "glossy_caustic";
};

}  // namespace usdmlt
