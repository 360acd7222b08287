// Lambert transmission: what arrives on one side leaves the other in all directions, as
// ND_translucent_bsdf. It bounds no medium, so radiance is not scaled.
#pragma once

#include "base/warps.hpp"
#include "materials/closure.hpp"

namespace usdmlt::translucent_lobe {

inline Spectrum evaluate(const Lobe& lobe, Vec3f l, Vec3f e) {
    return l.z * e.z < 0 ? lobe.weight * inv_pi : Spectrum();
}

inline float pdf(Vec3f known, Vec3f sampled) {
    return known.z * sampled.z < 0 ? std::fabs(sampled.z) * inv_pi : 0.0f;
}

inline Vec3f sample(Vec3f known, Vec2f u) {
    Vec3f w = square_to_cosine_hemisphere(u);
    if (known.z > 0) w.z = -w.z;
    return w;
}

}  // namespace usdmlt::translucent_lobe
