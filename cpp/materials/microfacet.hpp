// GGX microfacets, anisotropic (Trowbridge & Reitz 1975; Walter et al. 2007), with Smith's masking
// (Heitz 2014, "Understanding the masking-shadowing function in microfacet-based BRDFs").
//
// Local directions, macroscopic normal +z. Written with S(w) = √(w_z² + αx²w_x² + αy²w_y²), in
// which nothing overflows at grazing angles:
//     G1(w) = 2 |w_z| / (|w_z| + S(w)),
//     G2(a, b) = 1 / (1 + Λ(a) + Λ(b)) = 2 |a_z b_z| / (|b_z| S(a) + |a_z| S(b)).
// The same height-correlated G2 serves reflection and refraction; for refraction Smith's model
// gives a Beta function instead (Heitz et al. 2016), of the same first order and never above G1
// either.
#pragma once

#include <cmath>

#include "base/vec.hpp"

namespace usdmlt {

// At and below this alpha on both axes a lobe is smooth: Dirac.
inline constexpr float smooth_alpha = 1e-3f;

struct Ggx {
    float alpha_x, alpha_y;

    // D(h) = 1 / (π αx αy t²), t = (h_x/αx)² + (h_y/αy)² + h_z², so that ∫ D(h) h_z dω = 1.
    float distribution(Vec3f h) const {
        const float xy = alpha_x * alpha_y;
        const float t_xy2 = sqr(alpha_y * h.x) + sqr(alpha_x * h.y) + sqr(xy * h.z);
        return inv_pi * xy * sqr(xy / t_xy2);
    }
    float stretched_length(Vec3f w) const {  // S(w)
        return std::sqrt(sqr(w.z) + sqr(alpha_x * w.x) + sqr(alpha_y * w.y));
    }
    // G1(w) / |w_z|.
    float masking_over_cosine(Vec3f w) const { return 2 / (std::fabs(w.z) + stretched_length(w)); }
    // G2(a, b) / |a_z b_z|.
    float shadowing_over_cosines(Vec3f a, Vec3f b) const {
        return 2 / (std::fabs(b.z) * stretched_length(a) + std::fabs(a.z) * stretched_length(b));
    }
    // Density of the normals visible from w (w_z > 0): G1(w) max(0, w·h) D(h) / w_z.
    float visible_pdf(Vec3f w, Vec3f h) const {
        return masking_over_cosine(w) * std::fmax(dot(w, h), 0.0f) * distribution(h);
    }
    // Samples it: in the stretched space in which the surface is a hemisphere, reflecting w's
    // spherical cap (Dupuy & Benyoub 2023, "Sampling visible GGX normals with spherical caps").
    Vec3f sample_visible(Vec3f w, Vec2f u) const {
        const Vec3f s = normalize({alpha_x * w.x, alpha_y * w.y, w.z});
        const float phi = 2 * pi * u.x;
        const float h_z = (1 - u.y) * (1 + s.z);  // of the cap's direction plus s
        const float r = safe_sqrt(1 - sqr(h_z - s.z));
        const float h_x = r * std::cos(phi) + s.x, h_y = r * std::sin(phi) + s.y;
        return normalize({alpha_x * h_x, alpha_y * h_y, h_z});
    }
};

}  // namespace usdmlt
