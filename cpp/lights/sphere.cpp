#include "lights/sphere.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/warps.hpp"

namespace usdmlt {

namespace {

Vec2f fold(Vec2f p) {
    return {std::copysign(1 - std::fabs(p.y), p.x), std::copysign(1 - std::fabs(p.x), p.y)};
}

// Octahedral map of the sphere (Meyer et al. 2010).
Vec2f to_octahedral(Vec3f n) {
    const float s = 1 / (std::fabs(n.x) + std::fabs(n.y) + std::fabs(n.z));
    const Vec2f p{n.x * s, n.y * s};
    return n.z < 0 ? fold(p) : p;
}

Vec3f from_octahedral(Vec2f p) {
    const float z = 1 - std::fabs(p.x) - std::fabs(p.y);
    if (z < 0) p = fold(p);
    return normalize({p.x, p.y, z});
}

Vec3d to_unit(const SphereLight& light, Vec3d v) {
    return {dot(light.to_unit_x, v), dot(light.to_unit_y, v), dot(light.to_unit_z, v)};
}

// World area per area of the unit sphere: |cof(M)·n|.
double stretch(const SphereLight& light, Vec3d n) {
    return length(light.cofactor_x * n.x + light.cofactor_y * n.y + light.cofactor_z * n.z);
}

// The unit sphere as seen from a point p outside: a cone with sinθmax = 1/|p|.
struct Cap {
    Vec3d p;
    double distance2, distance, one_minus_cos_max;

    Cap(const SphereLight& light, Vec3f reference)
        : p(to_unit(light, to_double(reference) - to_double(light.from_unit.origin))),
          distance2(dot(p, p)),
          distance(std::sqrt(distance2)) {
        const double sin2_max = 1 / distance2;
        one_minus_cos_max = sin2_max / (1 + std::sqrt(std::max(1 - sin2_max, 0.0)));
    }

    bool visible() const { return distance2 > 1; }

    // The point of the sphere where the ray at angle θ to the axis enters, at angle α from the axis
    // as seen from the centre; 1 − cosθ uniform. With D = |p| and h = √(1 − D² sin²θ),
    // cosα = D sin²θ + h cosθ and sinα = sinθ (D cosθ − h).
    Vec3f sample(Vec2f u) const {
        const double t = u.x * one_minus_cos_max, cos_theta = 1 - t, sin2_theta = t * (2 - t);
        const double half_chord = std::sqrt(std::max(1 - distance2 * sin2_theta, 0.0));
        const double cos_alpha = distance * sin2_theta + cos_theta * half_chord;
        const double sin_alpha =
            std::sqrt(sin2_theta) * std::max(distance * cos_theta - half_chord, 0.0);
        const auto r = static_cast<float>(sin_alpha);
        const float phi = 2 * pi * u.y;
        const Frame frame = Frame::from_normal(to_float(p * (1 / distance)));
        return frame.to_world(
            {r * std::cos(phi), r * std::sin(phi), static_cast<float>(cos_alpha)});
    }

    // cosθ / (Ω d²) at n, per area of the unit sphere.
    double pdf(Vec3d n) const {
        const Vec3d to_p = p - n;
        const double d2 = dot(to_p, to_p), cosine_times_d = dot(to_p, n);
        const double solid_angle = 2 * std::numbers::pi * one_minus_cos_max;
        return cosine_times_d > 0 ? cosine_times_d / (solid_angle * d2 * std::sqrt(d2)) : 0;
    }
};

// ∫ |cof(M)·n| dn over half the unit sphere, twice; midpoints in z and φ.
double surface_area(const SphereLight& light) {
    constexpr int rows = 64, columns = 128;
    double sum = 0;
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i < columns; ++i) {
            const double z = (j + 0.5) / rows, r = std::sqrt(1 - z * z);
            const double phi = 2 * std::numbers::pi * (i + 0.5) / columns;
            sum += stretch(light, {r * std::cos(phi), r * std::sin(phi), z});
        }
    return sum * (4 * std::numbers::pi / (rows * columns));
}

}  // namespace

SphereLight::SphereLight(const Affine3f& transform, float radius)
    : from_unit{transform.x * radius, transform.y * radius, transform.z * radius,
                transform.origin} {
    const Vec3d x = to_double(from_unit.x), y = to_double(from_unit.y), z = to_double(from_unit.z);
    cofactor_x = cross(y, z);
    cofactor_y = cross(z, x);
    cofactor_z = cross(x, y);
    const double d = dot(cofactor_x, x);
    determinant = std::fabs(d);
    if (!(determinant > 0)) return;
    to_unit_x = cofactor_x * (1 / d);
    to_unit_y = cofactor_y * (1 / d);
    to_unit_z = cofactor_z * (1 / d);
    area = surface_area(*this);
}

LightPoint surface_point(const SphereLight& light, Vec2f uv) {
    const Vec3f n = from_octahedral(uv);
    LightPoint point;
    point.position = light.from_unit.point(n);
    point.normal = normalize(light.from_unit.normal(n));
    point.uv = uv;
    return point;
}

bool sample_area(const SphereLight& light, Vec2f u, Vec2f& uv, double& pdf) {
    uv = to_octahedral(square_to_sphere(u));
    pdf = pdf_area(light, uv);
    return true;
}

double pdf_area(const SphereLight& light, Vec2f uv) {
    return 1 / (4 * std::numbers::pi * stretch(light, to_double(from_octahedral(uv))));
}

bool sample_toward(const SphereLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf) {
    const Cap cap(light, reference);
    if (!cap.visible()) return false;
    uv = to_octahedral(cap.sample(u));
    const Vec3d n = to_double(from_octahedral(uv));
    pdf = cap.pdf(n) / stretch(light, n);
    return pdf > 0;
}

double pdf_toward(const SphereLight& light, Vec3f reference, Vec2f uv) {
    const Cap cap(light, reference);
    const Vec3d n = to_double(from_octahedral(uv));
    return cap.visible() ? cap.pdf(n) / stretch(light, n) : 0;
}

double projected_area(const SphereLight& light, Vec3d direction) {
    return std::numbers::pi * light.determinant * length(to_unit(light, direction));
}

// Solved in double, in the space of the unit sphere: the cancellation in |o|² − 1 − … is harmless
// for distant and small spheres, and the roots lose nothing near the rim.
bool intersect(const SphereLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv) {
    if (!(light.determinant > 0)) return false;
    const Vec3d o = to_unit(light, to_double(origin) - to_double(light.from_unit.origin));
    const Vec3d d = to_unit(light, to_double(direction));
    const double d2 = dot(d, d), closest = -dot(o, d) / d2;
    const Vec3d chord_middle = o + d * closest;
    const double half_chord2 = (1 - dot(chord_middle, chord_middle)) / d2;
    if (!(half_chord2 >= 0)) return false;
    const double half_chord = std::sqrt(half_chord2);
    for (const double root : {closest - half_chord, closest + half_chord}) {
        if (!(root > tnear && root < tfar)) continue;
        t = static_cast<float>(root);
        uv = to_octahedral(to_float(o + d * root));
        return true;
    }
    return false;
}

void bounds(const SphereLight& light, Vec3f& lower, Vec3f& upper) {
    const Affine3f& m = light.from_unit;
    const Vec3f extent{std::hypot(m.x.x, m.y.x, m.z.x), std::hypot(m.x.y, m.y.y, m.z.y),
                       std::hypot(m.x.z, m.y.z, m.z.z)};
    lower = m.origin - extent;
    upper = m.origin + extent;
}

}  // namespace usdmlt
