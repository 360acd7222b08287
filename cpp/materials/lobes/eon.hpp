// Rough diffuse reflection that keeps energy: EON (Portsmouth, Kutz & Hill 2025, "EON: a practical
// energy-preserving rough diffuse BRDF", JCGT 14(1)), as ND_oren_nayar_diffuse_bsdf with
// energy_compensation. Fujii's Oren–Nayar plus what it loses to multiple scattering:
//     f₁ = ρ/π (A + B s / t),  A = 1 / (1 + (1/2 − 2/3π) r),  B = r A,
//     s = l·e − l_z e_z,  t = max(l_z, e_z) where s > 0, else 1,
//     f₂ = ρ₂/π (1 − E(l)) (1 − E(e)) / (1 − E_avg),  ρ₂ = ρ² E_avg / (1 − ρ (1 − E_avg)),
// with E the albedo of f₁ for ρ = 1 and E_avg its mean. The albedo of the sum is 1 for ρ = 1.
// Samples are cosine-distributed, as for Lambert.
#pragma once

#include "materials/closure.hpp"

namespace usdmlt::eon_lobe {

inline constexpr float mean_slope = 2.0f / 3 - 28 / (15 * pi);  // of E_avg in B

inline float albedo(float a, float b, float cosine) {
    const float sine = safe_sqrt(1 - sqr(cosine)), theta = std::acos(std::fmin(cosine, 1.0f));
    // (2/3) (tanθ (1 − sin³θ) − sinθ), with 1 − sin³ = cos² (1 + s + s²) / (1 + s).
    const float tangent_term = sine * cosine * (1 + sine + sqr(sine)) / (1 + sine);
    const float g = sine * (theta - sine * cosine) + 2.0f / 3 * (tangent_term - sine);
    return a + b * inv_pi * g;
}

inline Spectrum evaluate(const Lobe& lobe, Vec3f l, Vec3f e) {
    if (l.z * e.z <= 0) return Spectrum();
    const float r = lobe.alpha_x, cos_l = std::fabs(l.z), cos_e = std::fabs(e.z);
    const float a = 1 / (1 + (0.5f - 2 / (3 * pi)) * r), b = r * a;
    const float s = dot(l, e) - l.z * e.z;
    const float single = a + b * (s > 0 ? s / std::fmax(cos_l, cos_e) : s);
    const float mean_albedo = a + b * mean_slope;
    const float lost = (1 - albedo(a, b, cos_l)) * (1 - albedo(a, b, cos_e));
    const float multiple = lost / std::fmax(1 - mean_albedo, 1e-7f);
    Spectrum f;
    for (int i = 0; i < 3; ++i) {
        const float rho = lobe.color0[i];
        const float rho2 = sqr(rho) * mean_albedo / (1 - rho * (1 - mean_albedo));
        f[i] = rho * single + rho2 * multiple;
    }
    return lobe.weight * f * inv_pi;
}

}  // namespace usdmlt::eon_lobe
