// Multi-chain perturbation (Veach 1997, §11.3.3), seen from the eye: E S* (D S+)+ and then a
// non-Dirac vertex that is connected to the next one, or the light itself. A lens perturbation
// first; where a chain of Dirac vertices leaves a non-Dirac one its direction is perturbed, and the
// walk goes on.
#pragma once

#include "mutations/lens_perturbation.hpp"

namespace usdmlt {

struct MultiChainPerturbation {
    static constexpr const char* name = "multi_chain";

    static bool applies(const MutationContext&, const Path& x) {
        const Walk walk = find_walk(x, Known::eye, x.edges());
        return walk.found() && walk.chains > 0;
    }
    static bool propose(MutationContext& context, const Path& x, Path& y, Change& change) {
        return lens_walk::propose(context, x, find_walk(x, Known::eye, x.edges()), y, change);
    }
    static ScaledDouble density(MutationContext& context, const Path& x, const Path& y,
                                const Change& change) {
        return lens_walk::density(context, x, y, change, find_walk(x, Known::eye, x.edges()));
    }
};

}  // namespace usdmlt
