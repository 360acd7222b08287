// Vertices that scatter nearly as mirrors do: narrow microfacet reflection. A perturbed walk passes
// them as it passes Dirac ones, but keeps the half vector, not the normal, between its directions
// (as Jakob & Marschner 2012 and Kaplanyan et al. 2014 treat glossy chains; here by tracing).
//
// The half vector h, relative to the shading normal, is the same in x and y. In the coordinates
// (what the walk starts with, h_1, h_2 …) the move is the identity in h, so that T needs the
// conversion from h to solid angle only: dω = 4 |ω·h| dσ(h) (Walter et al. 2007).
#pragma once

#include "paths/path.hpp"

namespace usdmlt {

// A narrow lobe's roughness, and how far from its normal h may be, in slopes relative to it: what
// is farther out is mostly the light of other lobes.
inline constexpr float widest_near_specular = 0.2f, steepest_near_specular = 4;

inline bool is_near_specular(const Closure& closure, Vec3f a, Vec3f b) {
    if (closure.is_lambert) return false;
    float alpha = 0;
    for (int i = 0; i < closure.lobe_count; ++i) {
        const Lobe& lobe = closure.lobes[i];
        if (lobe.delta || !lobe.reflects || is_diffuse(lobe.type) || lobe.type == LobeType::sheen)
            continue;
        const float wide = std::max(lobe.alpha_x, lobe.alpha_y);
        if (wide < widest_near_specular) alpha = std::max(alpha, wide);
    }
    const Vec3f n = closure.shading.z;
    if (alpha == 0 || dot(a, n) * dot(b, n) <= 0) return false;
    const Vec3f h = a + b;
    const float cosine2 = sqr(dot(h, n)), all2 = length_squared(h);
    return all2 - cosine2 <= sqr(steepest_near_specular * alpha) * cosine2;
}

inline bool is_near_specular(const Path& x, int i) {
    return i > 0 && i < x.edges() && !x.is_delta(i) &&
           is_near_specular(x[i].closure, x.to_light(i), x.to_eye(i));
}

inline bool has_near_specular(const Path& x) {
    for (int i = 1; i < x.edges(); ++i)
        if (is_near_specular(x, i)) return true;
    return false;
}

// The direction into which y_i, met from `known`, scatters with the half vector that x_i has; the
// shortest rotation takes the one normal to the other. False where there is none.
inline bool keep_half_vector(const Path& x, int i, const Vertex& v, Vec3f known, Vec3f& direction) {
    const Vec3f from = x[i].closure.shading.z, to = v.closure.shading.z;
    const float turned = 1 + dot(from, to);
    if (turned < 0.1f) return false;
    const Vec3f old = normalize(x.to_light(i) + x.to_eye(i)), sum = from + to;
    const Vec3f h = normalize(old - sum * (dot(sum, old) / turned) + to * (2 * dot(from, old)));
    // Two-sided surfaces may be met from below.
    const float cosine = dot(known, h);
    direction = h * (2 * cosine) - known;
    return cosine > 0 && dot(known, to) * dot(direction, to) > 0;
}

// Density in solid angle of a direction at angle acos(cosine) to h, where h has density 1.
inline double half_vector_pdf(Vec3f direction, Vec3f known) {
    return 1 / (4 * double(dot(direction, normalize(direction + known))));
}

}  // namespace usdmlt
