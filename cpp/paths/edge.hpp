// What lies between two vertices of a path.
#pragma once

#include "materials/closure.hpp"

namespace usdmlt {

// Both sides see the same mostly: rays that are traced along the edge, from the eye's or the
// light's side, then come to its end with the probability `transmittance`.
struct Edge {
    // Of surfaces.
    float transmittance = 1;             // factor of f: product of 1 − α
    float from_eye = 1, from_light = 1;  // probabilities that traced rays get through

    // Of media. What is made from the one side is a vertex at the other: the probability of
    // getting there or, where it is a point of a medium itself, the density per length of stopping.
    float media_from_eye = 1, media_from_light = 1;
    float media[3] = {1, 1, 1};  // transmittance: factor of f

    bool is_blocked() const { return transmittance == 0; }
    float survival_of_surfaces(Known role) const {
        return role == Known::eye ? from_eye : from_light;
    }
    float survival_of_media(Known role) const {
        return role == Known::eye ? media_from_eye : media_from_light;
    }
    float survival(Known role) const {
        return survival_of_surfaces(role) * survival_of_media(role);
    }
    Spectrum media_transmittance() const { return {media[0], media[1], media[2]}; }
    // What is left of a value, times a weight.
    Spectrum through(const Spectrum& value, double weight) const {
        return value * static_cast<float>(transmittance * weight) * media_transmittance();
    }
    // What a traced ray brings along.
    Spectrum media_weight(Known role) const {
        const float p = survival_of_media(role);
        return p > 0 ? media_transmittance() * (1 / p) : Spectrum();
    }
    void attenuate(float factor) {
        transmittance *= factor;
        from_eye *= factor;
        from_light *= factor;
    }
};

}  // namespace usdmlt
