// Multi-chain perturbation (Veach 1997, §11.3.3), seen from the eye: E S* (D S+)+ and then a
// non-Dirac vertex that is connected to the next one, or the light itself. A lens perturbation
// first; where a chain of Dirac vertices leaves a non-Dirac one its direction is perturbed, and the
// walk goes on.
#pragma once

#include "mutations/lens_perturbation.hpp"

namespace usdmlt {

struct MultiChainPerturbation : LensWalk<LensWalkKind::inner_chains> {
    static constexpr const char* name = "multi_chain";
};

}  // namespace usdmlt
