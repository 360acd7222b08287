// Orthonormal frames and affine transforms.
#pragma once

#include "base/vec.hpp"

namespace usdmlt {

// Right-handed orthonormal frame; z is the normal.
struct Frame {
    Vec3f x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};

    Vec3f to_local(Vec3f v) const { return {dot(v, x), dot(v, y), dot(v, z)}; }
    Vec3f to_world(Vec3f v) const { return x * v.x + y * v.y + z * v.z; }

    // Duff et al. 2017, "Building an orthonormal basis, revisited".
    static Frame from_normal(Vec3f n) {
        const float sign = std::copysign(1.0f, n.z);
        const float a = -1.0f / (sign + n.z);
        const float b = n.x * n.y * a;
        return {
            {1 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
    }
    // Gram–Schmidt of a tangent against the normal; falls back where they are parallel.
    static Frame from_normal_and_tangent(Vec3f n, Vec3f tangent) {
        const Vec3f t = tangent - n * dot(n, tangent);
        const float len2 = length_squared(t);
        if (!(len2 > 1e-12f * length_squared(tangent))) return from_normal(n);
        const Vec3f x = t * (1 / std::sqrt(len2));
        return {x, cross(n, x), n};
    }
};

// p ↦ (x y z)·p + origin: columns are the images of the axes.
struct Affine3f {
    Vec3f x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, origin{0, 0, 0};

    Vec3f point(Vec3f p) const { return x * p.x + y * p.y + z * p.z + origin; }
    Vec3f vector(Vec3f v) const { return x * v.x + y * v.y + z * v.z; }
    float determinant() const { return dot(cross(x, y), z); }
    // Cofactor matrix times n: the direction of a transformed normal, area-scaled; keeps the side
    // that was outside, also under mirroring.
    Vec3f normal(Vec3f n) const {
        const float s = determinant() < 0 ? -1.0f : 1.0f;
        return (cross(y, z) * n.x + cross(z, x) * n.y + cross(x, y) * n.z) * s;
    }
    Affine3f inverse() const {
        const float d = 1 / determinant();
        const Vec3f r0 = cross(y, z) * d, r1 = cross(z, x) * d, r2 = cross(x, y) * d;
        Affine3f inv{{r0.x, r1.x, r2.x}, {r0.y, r1.y, r2.y}, {r0.z, r1.z, r2.z}, {}};
        inv.origin = -inv.vector(origin);
        return inv;
    }
};

}  // namespace usdmlt
