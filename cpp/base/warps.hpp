// Sampling warps from the unit square, and their densities.
#pragma once

#include "base/vec.hpp"

namespace usdmlt {

// Concentric map to the unit disk (Shirley & Chiu 1997); density 1/π.
inline Vec2f square_to_disk(Vec2f u) {
    const float a = 2 * u.x - 1, b = 2 * u.y - 1;
    if (a == 0 && b == 0) return {0, 0};
    float r, phi;
    if (a * a > b * b) {
        r = a;
        phi = (pi / 4) * (b / a);
    } else {
        r = b;
        phi = (pi / 2) - (pi / 4) * (a / b);
    }
    return {r * std::cos(phi), r * std::sin(phi)};
}

// Cosine-weighted hemisphere about +z; density cosθ/π.
inline Vec3f square_to_cosine_hemisphere(Vec2f u) {
    const Vec2f d = square_to_disk(u);
    return {d.x, d.y, safe_sqrt(1 - d.x * d.x - d.y * d.y)};
}

// Uniform sphere; density 1/(4π).
inline Vec3f square_to_sphere(Vec2f u) {
    const float z = 1 - 2 * u.x, r = safe_sqrt(1 - z * z), phi = 2 * pi * u.y;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

// Uniform cone about +z; density 1/(2π·one_minus_cos). Takes 1 − cosθmax, which keeps its
// precision for narrow cones.
inline Vec3f square_to_cone(Vec2f u, float one_minus_cos) {
    const float t = u.x * one_minus_cos;  // 1 − cosθ
    const float z = 1 - t, r = safe_sqrt(t * (2 - t)), phi = 2 * pi * u.y;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace usdmlt
