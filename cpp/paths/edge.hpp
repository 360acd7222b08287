// What lies between two vertices of a path.
#pragma once

#include "materials/closure.hpp"

namespace usdmlt {

// Both sides see the same mostly: rays that are traced along the edge, from the eye's or the
// light's side, then come to its end with the probability `transmittance`.
struct Edge {
    float transmittance = 1;             // factor of f: product of 1 − α
    float from_eye = 1, from_light = 1;  // probabilities that traced rays get through

    bool is_blocked() const { return transmittance == 0; }
    float survival(Known role) const { return role == Known::eye ? from_eye : from_light; }
    void attenuate(float factor) {
        transmittance *= factor;
        from_eye *= factor;
        from_light *= factor;
    }
};

}  // namespace usdmlt
