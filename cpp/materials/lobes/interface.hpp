// Scattering at an interface, smooth or of GGX microfacets, for every Fresnel law: dielectric,
// conductor, generalised Schlick. Reflection and refraction after Walter et al. 2007, "Microfacet
// models for refraction through rough surfaces".
//
// With half vector h, F the reflectance at it, η relative indices of the two sides:
//     reflection   h ∝ l + e,           f = F D G2 / (4 |l_z e_z|)
//     refraction   h ∝ η_l l + η_e e,   f = η_e² (1−F) D G2 |l·h e·h| / (|l_z e_z| J),
//                                       J = (η_l l·h + η_e e·h)²
// (eq. 20, 21; η_e² / η_l² is the scaling of radiance). A direction is sampled by a visible normal
// of the known one, then reflection or refraction by their share of energy; densities (eq. 14, 17):
//     reflection   P_R D_visible(h) / (4 |k·h|),    refraction   P_T D_visible(h) |s·h| η_s² / J.
#pragma once

#include "materials/closure.hpp"
#include "materials/lobes/conductor.hpp"
#include "materials/lobes/dielectric.hpp"
#include "materials/lobes/schlick.hpp"
#include "materials/microfacet.hpp"

namespace usdmlt::interface_lobe {

// η_other / η_own as seen from one side. A two-sided lobe looks from below as from above.
inline float relative_index(const Lobe& lobe, bool above) {
    return lobe.is_interface && !above ? 1 / lobe.eta : lobe.eta;
}

inline Spectrum reflectance(const Lobe& lobe, float cos_i, float cos_t, float m) {
    switch (lobe.type) {
        case LobeType::conductor:
            return conductor_lobe::reflectance(lobe, cos_i);
        case LobeType::schlick:
            return schlick_lobe::reflectance(lobe, cos_i, cos_t, m);
        default:
            return dielectric_lobe::reflectance(lobe, cos_i, cos_t, m);
    }
}
inline Spectrum reflectance(const Lobe& lobe, float cos_i, bool above) {
    const float m = relative_index(lobe, above);
    return reflectance(lobe, cos_i, refracted_cosine(cos_i, m), m);
}

// How light that meets the interface at an angle is shared out: scattered energy R and T, and the
// probabilities with which a sample is reflected and refracted.
struct Split {
    Spectrum R, T;
    float P_R, P_T;
};

inline Split split(const Lobe& lobe, float cos_i, bool above) {
    const float m = relative_index(lobe, above);
    const float cos_t = refracted_cosine(cos_i, m);
    const Spectrum f = reflectance(lobe, cos_i, cos_t, m);
    Split s{};
    if (lobe.reflects) s.R = lobe.weight * f;
    if (lobe.transmits && cos_t > 0)
        s.T = lobe.weight * lobe.tint_transmission * (Spectrum(1.0f) - f);
    const float r = mean(s.R), t = mean(s.T);
    if (r + t > 0) {
        s.P_R = r / (r + t);
        s.P_T = t / (r + t);
    }
    return s;
}

// Half vector of a pair of directions, with what both the value and the density need.
struct HalfVector {
    Vec3f h;             // h_z ≥ 0
    float cos_a, cos_b;  // |a·h|, |b·h|
    float jacobian;      // refraction: J
    bool valid;
};

// The split of a pair that refracts, from the side of the smaller index: there is no total
// reflection there, and rounding cannot make one.
inline Split split_refraction(const Lobe& lobe, float cos_above, float cos_below) {
    return lobe.eta > 1 ? split(lobe, cos_above, true) : split(lobe, cos_below, false);
}

inline HalfVector half_vector(const Lobe& lobe, Vec3f a, Vec3f b, bool reflection) {
    const float eta_a = reflection || a.z > 0 ? 1 : lobe.eta;
    const float eta_b = reflection || b.z > 0 ? 1 : lobe.eta;
    Vec3f h = a * eta_a + b * eta_b;
    const float len2 = length_squared(h);
    if (!(len2 > 0)) return {{}, 0, 0, 0, false};
    h = h * (std::copysign(1.0f, h.z) / std::sqrt(len2));
    const float a_h = dot(a, h), b_h = dot(b, h);
    // Microfacets are seen from the same side as the surface.
    const bool valid = a_h * a.z > 0 && b_h * b.z > 0;
    return {h, std::fabs(a_h), std::fabs(b_h), sqr(eta_a * a_h + eta_b * b_h), valid};
}

inline Spectrum evaluate(const Lobe& lobe, Vec3f l, Vec3f e) {
    const bool reflection = l.z * e.z > 0;
    if (!(reflection ? lobe.reflects : lobe.transmits)) return Spectrum();
    const HalfVector v = half_vector(lobe, l, e, reflection);
    if (!v.valid) return Spectrum();
    const Ggx ggx{lobe.alpha_x, lobe.alpha_y};
    const float dg = ggx.distribution(v.h) * ggx.shadowing_over_cosines(l, e);
    if (reflection) return split(lobe, v.cos_b, e.z > 0).R * (0.25f * dg);
    const bool e_above = e.z > 0;
    const Split s = e_above ? split_refraction(lobe, v.cos_b, v.cos_a)
                            : split_refraction(lobe, v.cos_a, v.cos_b);
    return s.T * (sqr(e_above ? 1 : lobe.eta) * dg * v.cos_a * v.cos_b / v.jacobian);
}

inline float pdf(const Lobe& lobe, Vec3f known, Vec3f sampled) {
    const bool reflection = known.z * sampled.z > 0;
    if (!(reflection ? lobe.reflects : lobe.transmits)) return 0;
    const HalfVector v = half_vector(lobe, known, sampled, reflection);
    if (!v.valid) return 0;
    const Ggx ggx{lobe.alpha_x, lobe.alpha_y};
    const float dg = ggx.distribution(v.h) * ggx.masking_over_cosine(known);
    if (reflection) {
        const float p = lobe.transmits ? split(lobe, v.cos_a, known.z > 0).P_R : 1.0f;
        return p * 0.25f * dg;
    }
    const bool sampled_above = sampled.z > 0;
    const Split s = sampled_above ? split_refraction(lobe, v.cos_b, v.cos_a)
                                  : split_refraction(lobe, v.cos_a, v.cos_b);
    return s.P_T * sqr(sampled_above ? 1 : lobe.eta) * dg * v.cos_a * v.cos_b / v.jacobian;
}

// w mirrored, or refracted, at the plane with normal h (h·w > 0).
inline Vec3f reflect(Vec3f w, Vec3f h) { return h * (2 * dot(w, h)) - w; }
inline Vec3f refract(Vec3f w, Vec3f h, float m) {
    const float cos_i = dot(w, h);
    return h * (cos_i / m - refracted_cosine(cos_i, m)) - w * (1 / m);
}

// One side's P is certain where the lobe does only that; a sample is lost where nothing is
// scattered.
inline bool sample(const Lobe& lobe, Vec3f known, float u_lobe, Vec2f u, Vec3f& sampled) {
    const float side = known.z > 0 ? 1.0f : -1.0f;
    const Vec3f k{known.x, known.y, known.z * side};
    const Vec3f h = Ggx{lobe.alpha_x, lobe.alpha_y}.sample_visible(k, u);
    const float cos_i = dot(k, h);
    if (!(cos_i > 0)) return false;
    const Split s = split(lobe, cos_i, side > 0);
    if (u_lobe < s.P_R || (lobe.reflects && !lobe.transmits)) {
        sampled = reflect(k, h);
        if (!(sampled.z > 0)) return false;
    } else {
        if (!(s.P_T > 0)) return false;
        sampled = refract(k, h, relative_index(lobe, side > 0));
        if (!(sampled.z < 0)) return false;
    }
    sampled = normalize(sampled);
    sampled.z *= side;
    return true;
}

}  // namespace usdmlt::interface_lobe
