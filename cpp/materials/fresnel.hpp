// Fresnel reflectance of smooth interfaces. Cosines are of the angle to the (micro)normal and not
// negative.
#pragma once

#include <cmath>

#include "base/spectrum.hpp"
#include "base/vec.hpp"

namespace usdmlt {

// Snell's law for a relative index m = η_transmitted / η_incident: cosθ_t, or 0 at and beyond the
// critical angle (total internal reflection).
inline float refracted_cosine(float cos_i, float m) {
    return safe_sqrt(1 - (1 - sqr(cos_i)) / sqr(m));
}

// Unpolarised reflectance between two dielectrics (Born & Wolf, Principles of Optics, §1.5.2);
// cos_t from refracted_cosine, so 1 under total internal reflection.
inline float fresnel_dielectric(float cos_i, float cos_t, float m) {
    if (m == 1) return 0;
    const float parallel = m * cos_i - cos_t, parallel_sum = m * cos_i + cos_t;
    const float perpendicular = cos_i - m * cos_t, perpendicular_sum = cos_i + m * cos_t;
    // ½ (r∥² + r⊥²), with one division.
    return 0.5f * (sqr(parallel * perpendicular_sum) + sqr(perpendicular * parallel_sum)) /
           sqr(parallel_sum * perpendicular_sum);
}
inline float fresnel_dielectric(float cos_i, float m) {
    return fresnel_dielectric(cos_i, refracted_cosine(cos_i, m), m);
}

// Unpolarised reflectance of a metal of complex index eta + i k (Born & Wolf §14.2, in the form
// without complex numbers: with a² + b² = |(η + ik)² − sin²θ| and 2a² = that + Re).
inline float fresnel_conductor(float cos_i, float eta, float k) {
    const float c2 = sqr(cos_i), s2 = 1 - c2;
    const float real = sqr(eta) - sqr(k) - s2;
    const float a2_plus_b2 = std::sqrt(sqr(real) + sqr(2 * eta * k));
    const float a = safe_sqrt(0.5f * (a2_plus_b2 + real));
    const float perpendicular =
        (a2_plus_b2 + c2 - 2 * a * cos_i) / (a2_plus_b2 + c2 + 2 * a * cos_i);
    const float x = c2 * a2_plus_b2 + sqr(s2), y = 2 * a * cos_i * s2;
    return 0.5f * perpendicular * (1 + (x - y) / (x + y));
}

// Schlick's approximation with free end colours and exponent: F0 + (F90 − F0)(1 − cosθ)^p.
inline float schlick_power(float cos_i, float exponent) {
    const float x = clamp01(1 - cos_i);
    return exponent == 5 ? sqr(sqr(x)) * x : std::pow(x, exponent);
}
inline Spectrum fresnel_schlick(float cos_i, const Spectrum& f0, const Spectrum& f90,
                                float exponent) {
    return f0 + (f90 - f0) * schlick_power(cos_i, exponent);
}

// A tint at about 82°, where cosθ = 1/7 (Hoffman 2023, "Generalization of Adobe's Fresnel model"):
// Schlick's F less edge · cosθ (1 − cosθ)⁶, with the edge for which F is F_Schlick · tint there.
inline float edge_curve(float cos_i) {
    return cos_i * sqr(sqr(clamp01(1 - cos_i))) * sqr(1 - cos_i);
}
inline Spectrum schlick_edge(const Spectrum& f0, const Spectrum& f90, float exponent,
                             const Spectrum& tint) {
    constexpr float cosine = 1.0f / 7;
    const Spectrum there = fresnel_schlick(cosine, f0, f90, exponent);
    Spectrum edge;
    for (int i = 0; i < 3; ++i) edge[i] = there[i] * (1 - clamp01(tint[i])) / edge_curve(cosine);
    return edge;
}

}  // namespace usdmlt
