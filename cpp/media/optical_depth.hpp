// Optical depths along a ray, and where a traced ray collides.
//
// Media whose σ_s is 0 only attenuate: nothing stops there. In the others a traced ray stops after
// the distance t with the density
//     p(t) = 1/3 Σ_c σ_c(t) e^(−τ_c(t)),
// the mixture over channels of what would be best for each (one-sample model; Veach 1997, §9.2.4):
// chromatic media without bias, and with weights of 3 at most.
#pragma once

#include "base/rng.hpp"
#include "media/media.hpp"

namespace usdmlt {

struct OpticalDepth {
    double all[3] = {0, 0, 0};      // of what attenuates,
    double sampled[3] = {0, 0, 0};  // and of where rays may stop
};

// e^−τ of both: grey media and those that scatter everywhere need one or three exponentials.
struct Attenuation {
    double transmittance[3], free[3];

    explicit Attenuation(const OpticalDepth& depth) {
        for (int c = 0; c < 3; ++c) {
            const bool again = c > 0 && depth.all[c] == depth.all[0];
            transmittance[c] = again ? transmittance[0] : std::exp(-depth.all[c]);
            free[c] =
                depth.sampled[c] == depth.all[c] ? transmittance[c] : std::exp(-depth.sampled[c]);
        }
    }
    // That no collision is sampled on the way,
    double probability() const { return (free[0] + free[1] + free[2]) / 3; }
    // or that one is sampled at its end, per length; `extinction` is that of the point.
    double density(const Spectrum& extinction) const {
        return (extinction[0] * free[0] + extinction[1] * free[1] + extinction[2] * free[2]) / 3;
    }
};

// ∫ of a medium's density from t0 to t1.
double integrated_density(const Medium& medium, const Ray& ray, float t0, float t1);

OpticalDepth optical_depth(const Media& media, const Ray& ray, Media::Scratch& scratch);

// ∫ ε T / P dt along a ray: what media add that glow, T being the transmittance back to the ray's
// start, and P the probability that a ray which stops at random gets there. By one random number
// u for all pieces, and exactly where nothing stops.
Spectrum glow(const Media& media, const Ray& ray, double u, Media::Scratch& scratch);

// A point of a ray where a medium scatters.
struct Collision {
    const Medium* medium = nullptr;  // null: none before the ray's end
    float t = 0;
};

Collision sample_collision(const Media& media, const Ray& ray, RandomStream& random,
                           Media::Scratch& scratch);

// At a given distance.
Collision collision_at(const Media& media, const Ray& ray, float t, Media::Scratch& scratch);

}  // namespace usdmlt
