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
    float P_R = 0, P_T = 0;
    float cos_t = 0;  // of the refracted direction, 0 under total reflection
};

inline Split split(const Lobe& lobe, float cos_i, bool above) {
    const float m = relative_index(lobe, above);
    const float cos_t = refracted_cosine(cos_i, m);
    const Spectrum f = reflectance(lobe, cos_i, cos_t, m);
    Split s;
    s.cos_t = cos_t;
    if (lobe.reflects)
        s.R = lobe.type == LobeType::dielectric ? lobe.weight * lobe.color0 * f : lobe.weight * f;
    if (lobe.transmits && cos_t > 0)
        s.T = lobe.weight * lobe.tint_transmission * (Spectrum(1.0f) - f);
    const float r = mean(s.R), t = mean(s.T);
    if (r + t > 0) {
        s.P_R = r / (r + t);
        s.P_T = 1 - s.P_R;
    }
    return s;
}

// The split of a pair that refracts, from the side of the smaller index: there is no total
// reflection there, and rounding cannot make one.
inline Split split_refraction(const Lobe& lobe, float cos_above, float cos_below) {
    return lobe.eta > 1 ? split(lobe, cos_above, true) : split(lobe, cos_below, false);
}

// Two directions and the microfacets that join them: what the value and the densities share.
struct Pair {
    bool joined = false;  // the lobe scatters from one to the other
    bool reflection;
    float D;                  // density of the microfacets' normals
    float cos_a, cos_b;       // |a·h|, |b·h|
    float refraction_factor;  // |a·h b·h| / J
    Split split;
};

// The split is left out where only the density is wanted and does not depend on it.
inline Pair join(const Lobe& lobe, Vec3f a, Vec3f b, bool only_density = false) {
    Pair pair;
    pair.reflection = a.z * b.z > 0;
    if (!(pair.reflection ? lobe.reflects : lobe.transmits)) return pair;
    const float eta_a = pair.reflection || a.z > 0 ? 1 : lobe.eta;
    const float eta_b = pair.reflection || b.z > 0 ? 1 : lobe.eta;
    Vec3f h = a * eta_a + b * eta_b;
    const float len2 = length_squared(h);
    if (!(len2 > 0)) return pair;
    h = h * (std::copysign(1.0f, h.z) / std::sqrt(len2));
    const float a_h = dot(a, h), b_h = dot(b, h);
    // Microfacets are seen from the same side as the surface.
    pair.joined = a_h * a.z > 0 && b_h * b.z > 0;
    if (!pair.joined) return pair;
    pair.D = Ggx{lobe.alpha_x, lobe.alpha_y}.distribution(h);
    pair.cos_a = std::fabs(a_h);
    pair.cos_b = std::fabs(b_h);
    if (pair.reflection) {
        if (!only_density || lobe.transmits) pair.split = split(lobe, pair.cos_a, a.z > 0);
    } else {
        pair.refraction_factor = pair.cos_a * pair.cos_b / sqr(eta_a * a_h + eta_b * b_h);
        pair.split = a.z > 0 ? split_refraction(lobe, pair.cos_a, pair.cos_b)
                             : split_refraction(lobe, pair.cos_b, pair.cos_a);
    }
    return pair;
}

inline float eta_squared(const Lobe& lobe, Vec3f w) { return w.z > 0 ? 1 : sqr(lobe.eta); }

inline Spectrum value(const Lobe& lobe, const Pair& pair, Vec3f l, Vec3f e) {
    const float dg = pair.D * Ggx{lobe.alpha_x, lobe.alpha_y}.shadowing_over_cosines(l, e);
    if (pair.reflection) return pair.split.R * (0.25f * dg);
    return pair.split.T * (dg * pair.refraction_factor * eta_squared(lobe, e));
}

inline float density(const Lobe& lobe, const Pair& pair, Vec3f known, Vec3f sampled) {
    const float dg = pair.D * Ggx{lobe.alpha_x, lobe.alpha_y}.masking_over_cosine(known);
    // A lobe that only reflects samples reflection, also where it reflects nothing.
    if (pair.reflection) return (lobe.transmits ? pair.split.P_R : 1.0f) * 0.25f * dg;
    return pair.split.P_T * dg * pair.refraction_factor * eta_squared(lobe, sampled);
}

inline Spectrum evaluate(const Lobe& lobe, Vec3f l, Vec3f e) {
    const Pair pair = join(lobe, l, e);
    return pair.joined ? value(lobe, pair, l, e) : Spectrum();
}

inline float pdf(const Lobe& lobe, Vec3f known, Vec3f sampled) {
    const Pair pair = join(lobe, known, sampled, true);
    return pair.joined ? density(lobe, pair, known, sampled) : 0.0f;
}

// w mirrored, or refracted, at the plane with normal h (h·w > 0).
inline Vec3f reflect(Vec3f w, Vec3f h) { return h * (2 * dot(w, h)) - w; }
inline Vec3f refract(Vec3f w, Vec3f h, float m, float cos_t) {
    const float inverse = 1 / m;
    return h * (dot(w, h) * inverse - cos_t) - w * inverse;
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
        sampled = refract(k, h, relative_index(lobe, side > 0), s.cos_t);
        if (!(sampled.z < 0)) return false;
    }
    sampled = normalize(sampled);
    sampled.z *= side;
    return true;
}

}  // namespace usdmlt::interface_lobe
