#include "lights/cylinder.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace usdmlt {

namespace {

constexpr double two_pi = 2 * std::numbers::pi;

Vec3d to_unit(const CylinderLight& light, Vec3d v) {
    return {dot(light.to_unit_x, v), dot(light.to_unit_y, v), dot(light.to_unit_z, v)};
}

Vec3d relative(const CylinderLight& light, Vec3f position) {
    return to_double(position) - to_double(light.from_unit.origin);
}

// World area per unit of x and of φ: |X × ∂P/∂φ|.
double stretch(const CylinderLight& light, double phi) {
    const Affine3f& m = light.from_unit;
    const Vec3d tangent = to_double(m.z) * std::cos(phi) - to_double(m.y) * std::sin(phi);
    return length(cross(to_double(m.x), tangent));
}

// What a reference sees: in the cross-section before the transform, the arc of a unit circle seen
// from distance ρ > 1 within ±θmax, sinθmax = 1/ρ; along the axis, a segment.
struct View {
    const CylinderLight& light;
    Vec3d reference;  // relative to the origin of the unit cylinder
    double y, z, rho, theta_max;

    View(const CylinderLight& light, Vec3f position)
        : light(light), reference(relative(light, position)) {
        const Vec3d p = to_unit(light, reference);
        y = p.y;
        z = p.z;
        rho = std::hypot(y, z);
        theta_max = visible() ? std::asin(1 / rho) : 0;
    }

    bool visible() const { return rho > 1; }

    // The circle's point where the ray at angle θ enters, θ uniform; compare Cap of the sphere.
    double sample_phi(double u) const {
        const double theta = (2 * u - 1) * theta_max, s = std::sin(theta), c = std::cos(theta);
        const double half_chord = std::sqrt(std::max(1 - sqr(rho * s), 0.0));
        const double alpha = std::atan2(s * (rho * c - half_chord), rho * s * s + c * half_chord);
        return std::atan2(z, y) + alpha;
    }

    // Equiangular sampling (Kulla & Fajardo 2012) of the line of constant φ: with s the closest
    // point of the line and D the distance to it in units of the axis, density
    // D / (Θ (D² + (x − s)²)), Θ the angle that the segment subtends.
    struct Line {
        double s, d, theta0, theta1;
        double pdf_phi;  // dθ/dφ / 2θmax, over the area per unit of x and of φ

        double sample(double u) const {
            return std::clamp(s + d * std::tan(theta0 + u * (theta1 - theta0)), 0.0, 1.0);
        }
        double pdf(double x) const { return d / ((theta1 - theta0) * (d * d + sqr(x - s))); }
    };

    Line line(double phi) const {
        const Affine3f& m = light.from_unit;
        const double cosine = std::cos(phi), sine = std::sin(phi);
        const Vec3d axis = to_double(m.x), my = to_double(m.y), mz = to_double(m.z);
        const Vec3d w = reference - my * cosine - mz * sine;
        const double axis2 = dot(axis, axis), s = dot(w, axis) / axis2;
        const Vec3d nearest = w - axis * s;
        const double d = std::max(std::sqrt(dot(nearest, nearest) / axis2), 1e-6);
        const double facing = y * cosine + z * sine - 1;
        const double angular = facing / (2 * theta_max * (sqr(y - cosine) + sqr(z - sine)));
        const double area = length(cross(axis, mz * cosine - my * sine));
        return {s, d, std::atan(-s / d), std::atan((1 - s) / d), facing > 0 ? angular / area : 0};
    }
};

}  // namespace

CylinderLight::CylinderLight(const Affine3f& transform, float radius, float length)
    : from_unit{transform.x * length, transform.y * radius, transform.z * radius,
                transform.point({-0.5f * length, 0, 0})} {
    const Vec3d x = to_double(from_unit.x), y = to_double(from_unit.y), z = to_double(from_unit.z);
    const double d = dot(cross(x, y), z);
    determinant = std::fabs(d);
    if (!(determinant > 0)) return;
    to_unit_x = cross(y, z) * (1 / d);
    to_unit_y = cross(z, x) * (1 / d);
    to_unit_z = cross(x, y) * (1 / d);
    constexpr int count = 1024;  // of a smooth periodic function: converges exponentially
    for (int i = 0; i < count; ++i) area += stretch(*this, two_pi * i / count) * two_pi / count;
}

LightPoint surface_point(const CylinderLight& light, Vec2f uv) {
    const auto phi = static_cast<float>(two_pi * uv.y);
    const float c = std::cos(phi), s = std::sin(phi);
    LightPoint point;
    point.position = light.from_unit.point({uv.x, c, s});
    point.normal = normalize(light.from_unit.normal({0, c, s}));
    point.uv = uv;
    return point;
}

bool sample_area(const CylinderLight& light, Vec2f u, Vec2f& uv, double& pdf) {
    uv = u;
    pdf = pdf_area(light, uv);
    return true;
}

double pdf_area(const CylinderLight& light, Vec2f uv) {
    return 1 / (two_pi * stretch(light, two_pi * uv.y));
}

bool sample_toward(const CylinderLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf) {
    const View view(light, reference);
    if (!view.visible()) return false;
    const double turns = view.sample_phi(u.x) / two_pi;
    uv.y = static_cast<float>(turns - std::floor(turns));
    const View::Line line = view.line(two_pi * uv.y);
    uv.x = static_cast<float>(line.sample(u.y));
    pdf = line.pdf(uv.x) * line.pdf_phi;
    return pdf > 0;
}

double pdf_toward(const CylinderLight& light, Vec3f reference, Vec2f uv) {
    const View view(light, reference);
    if (!view.visible()) return 0;
    const View::Line line = view.line(two_pi * uv.y);
    return line.pdf(uv.x) * line.pdf_phi;
}

// n dA = (X × ∂P/∂φ) dx dφ turns sinusoidally with φ: half of its turn faces any direction.
double projected_area(const CylinderLight& light, Vec3d direction) {
    const Vec3d x = to_double(light.from_unit.x);
    const double a = dot(cross(x, to_double(light.from_unit.y)), direction);
    const double b = dot(cross(x, to_double(light.from_unit.z)), direction);
    return 2 * std::hypot(a, b);
}

bool intersect(const CylinderLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv) {
    if (!(light.determinant > 0)) return false;
    const Vec3d o = to_unit(light, relative(light, origin));
    const Vec3d d = to_unit(light, to_double(direction));
    const double d2 = d.y * d.y + d.z * d.z;
    const double closest = -(o.y * d.y + o.z * d.z) / d2;
    const double half_chord2 = (1 - sqr(o.y + closest * d.y) - sqr(o.z + closest * d.z)) / d2;
    if (!(half_chord2 >= 0)) return false;  // also a ray along the axis: NaN
    const double half_chord = std::sqrt(half_chord2);
    for (const double root : {closest - half_chord, closest + half_chord}) {
        const double x = o.x + root * d.x;
        if (!(root > tnear && root < tfar && x >= 0 && x <= 1)) continue;
        const double turns = std::atan2(o.z + root * d.z, o.y + root * d.y) / two_pi;
        t = static_cast<float>(root);
        uv = {static_cast<float>(x), static_cast<float>(turns - std::floor(turns))};
        return true;
    }
    return false;
}

void bounds(const CylinderLight& light, Vec3f& lower, Vec3f& upper) {
    const Affine3f& m = light.from_unit;
    const Vec3f extent{std::hypot(m.y.x, m.z.x), std::hypot(m.y.y, m.z.y),
                       std::hypot(m.y.z, m.z.z)};
    const Vec3f a = m.origin, b = m.origin + m.x;
    lower = min(a, b) - extent;
    upper = max(a, b) + extent;
}

}  // namespace usdmlt
