// Layers: what lies below a layer is scaled by what the layer lets through, on the way in and on
// the way out.
//
// A layer lets through T(ω) = 1 − Σ c_i E_i(ω), with E_i the directional albedo of its reflecting
// lobes and c_i their scalar weight; lobes that leave no light to pass on (diffuse, conductors,
// dielectrics that transmit by themselves) take their whole coverage. Layers over layers multiply.
// Light scattered between base and layer is not followed: what would come back is lost.
//
// The base's f(l, e) is multiplied by
//     diffuse lobes:  T(l) T(e) / T_avg,  T_avg = ∫ T |cosθ| dω / π,
//     others:         min(T(l), T(e)).
// Both are symmetric in l and e, so the layered f is as reciprocal as its parts, and neither lets
// the stack reflect more than E + T·(albedo of the base) ≤ 1: for a diffuse base the normalisation
// gives exactly that (Kelemen & Szirmay-Kalos 2001, "A microfacet based coupled specular-matte BRDF
// model", eq. 12), and min(T(l), T(e)) ≤ T of either. For the mirror direction of a specular base
// T(l) = T(e), and the minimum is just T once, which is what albedo scaling in MaterialX gives.
// T(l) T(e) without the normalisation would be reciprocal too, but darkens what is below by twice
// the layer's albedo.
#pragma once

#include "materials/closure.hpp"

namespace usdmlt {

// What a local direction meets at the layers. In unions so that only what is used is touched:
// without layers, nothing.
struct Passage {
    Passage(const Closure& closure, Vec3f w) {
        if (closure.cover_count > 0) compute(closure, w);
    }

    union {
        Spectrum through[max_lobes];  // by cover: what it and all above it let through together
    };
    union {
        Spectrum albedo[max_lobes];  // by lobe, weight not included: those that layers consist of
    };
    uint8_t has_albedo = 0;  // bit per lobe

private:
    void compute(const Closure& closure, Vec3f w);
};

// The factor on a covered lobe's value.
Spectrum coupling(const Closure& closure, const Lobe& lobe, Vec3f l, const Passage& of_l, Vec3f e,
                  const Passage& of_e);

// Sets Cover::average of the covers that lie directly on diffuse lobes.
void average_covers(Closure& closure);

}  // namespace usdmlt
