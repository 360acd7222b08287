// Multi-chain perturbation whose inner chains are aimed at where the old ones ended, see aim.hpp:
// suffix (L|D) D (S|G)+ (D (S|G)+)* … from the eye, where a perturbed direction alone would miss.
#pragma once

#include "mutations/lens_perturbation.hpp"

namespace usdmlt {

struct AimedPerturbation : LensWalk<LensWalkKind::aimed> {
    static constexpr const char* name = "aimed";
};

}  // namespace usdmlt
