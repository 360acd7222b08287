// Sheen: fibres that stand up, as ND_sheen_bsdf (Estevez & Kulla 2017, "Production friendly
// microfacet sheen BRDF"), with Neubelt & Pettineo's visibility (2013, "Crafting a next-gen
// material pipeline for The Order: 1886"):
//     f = D(h) / (4 (l_z + e_z − l_z e_z)),   D = (2 + p) sinᵖθ_h / 2π,   p = 1 / roughness.
// Its albedo grows towards grazing angles, to
//     E₀ = (2 + p) / π · ∫₀^{π/2} sin^{p+2} dθ = (2 + p) / (2 √π) · Γ((p + 3) / 2) / Γ(p / 2 + 2),
// which is above 1 for roughness below 0.2; there the lobe is divided by it, so that it never
// reflects more than it receives. Reciprocal as it stands.
#pragma once

#include <cmath>

#include "base/warps.hpp"
#include "materials/closure.hpp"

namespace usdmlt::sheen_lobe {

inline constexpr float least_roughness = 0.01f;  // at which p is 100

// Sets what evaluate needs: p and the constant in front.
inline void prepare(Lobe& lobe) {
    lobe.alpha_x = std::fmax(lobe.alpha_x, least_roughness);
    const float p = 1 / lobe.alpha_x;
    const float grazing = (2 + p) * 0.282094792f *  // 1 / (2 √π)
                          std::exp(std::lgamma(0.5f * (p + 3)) - std::lgamma(0.5f * p + 2));
    lobe.exponent = p;
    lobe.alpha_y = (2 + p) * (0.125f * inv_pi) / std::fmax(grazing, 1.0f);
}

// Without weight.
inline float value(const Lobe& lobe, Vec3f l, Vec3f e) {
    if (l.z * e.z <= 0) return 0;
    const Vec3f h = l + e;
    const float sine2 = (sqr(h.x) + sqr(h.y)) / length_squared(h);
    const float a = std::fabs(l.z), b = std::fabs(e.z);
    return lobe.alpha_y * std::pow(sine2, 0.5f * lobe.exponent) / (a + b - a * b);
}

inline Spectrum evaluate(const Lobe& lobe, Vec3f l, Vec3f e) {
    return lobe.weight * value(lobe, l, e);
}

// Uniform over the hemisphere: the value times the cosine varies little.
inline float pdf(Vec3f known, Vec3f sampled) {
    return known.z * sampled.z > 0 ? 0.5f * inv_pi : 0.0f;
}
inline Vec3f sample(Vec3f known, Vec2f u) {
    const float z = 1 - u.y, r = safe_sqrt(1 - sqr(z)), phi = 2 * pi * u.x;
    return {r * std::cos(phi), r * std::sin(phi), known.z < 0 ? -z : z};
}

}  // namespace usdmlt::sheen_lobe
