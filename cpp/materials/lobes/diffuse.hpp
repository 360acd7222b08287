// Diffuse reflection: Lambert, and Oren & Nayar's rough diffuse surface in its qualitative form
// (1994, eq. 30), with σ used as MaterialX uses it. Its albedo is up to 1.5 % above 1 for a white
// surface of σ ≈ 0.2 at grazing angles; that is the model's own, and MaterialX's.
#pragma once

#include "base/warps.hpp"
#include "materials/closure.hpp"

namespace usdmlt::diffuse_lobe {

// weight / π · (A + B max(0, cosΔφ) sinα tanβ), α the larger and β the smaller polar angle:
// sinα tanβ cosΔφ = (l·e − l_z e_z) / max(l_z, e_z).
inline Spectrum evaluate(const Lobe& lobe, Vec3f l, Vec3f e) {
    if (l.z * e.z <= 0) return Spectrum();
    const float sigma2 = sqr(lobe.alpha_x);
    if (sigma2 == 0) return lobe.weight * inv_pi;
    const float a = 1 - 0.5f * sigma2 / (sigma2 + 0.33f);
    const float b = 0.45f * sigma2 / (sigma2 + 0.09f);
    const float s = std::fmax(dot(l, e) - l.z * e.z, 0.0f);
    return lobe.weight * (inv_pi * (a + b * s / std::fmax(std::fabs(l.z), std::fabs(e.z))));
}

inline float pdf(Vec3f known, Vec3f sampled) {
    return known.z * sampled.z > 0 ? std::fabs(sampled.z) * inv_pi : 0.0f;
}

inline Vec3f sample(Vec3f known, Vec2f u) {
    Vec3f w = square_to_cosine_hemisphere(u);
    if (known.z < 0) w.z = -w.z;
    return w;
}

}  // namespace usdmlt::diffuse_lobe
