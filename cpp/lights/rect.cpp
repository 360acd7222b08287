#include "lights/rect.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace usdmlt {

namespace {

// Closer than this many diagonals to the centre, sampling by solid angle is worth its cost.
constexpr double near_in_diagonals = 1;

// The rectangle [x0, x1] × [y0, y1] at height z > 0 over a reference point at the origin, and the
// angles of Ureña, Fajardo & King 2013, "An area-preserving parametrization for spherical
// rectangles". With a = (−y0, x1, y1, −x0) / √(·² + z²), the angle between the planes of adjacent
// edges is γ_i = acos(−a_i a_i+1) = π/2 + asin(a_i a_i+1), and asin(a_i a_i+1) is the argument of
// (z r + i·x y) at their common corner (x, y), r its distance.
struct SphericalRectangle {
    double x0, x1, y0, y1, z;
    double k, solid_angle;

    SphericalRectangle(const RectLight& light, Vec3f reference) {
        const Vec3d d = to_double(light.corner) - to_double(reference);
        const Vec3d eu = to_double(light.edge_u), ev = to_double(light.edge_v);
        const double width = length(eu), height = length(ev);
        x0 = dot(d, eu) / width;
        y0 = dot(d, ev) / height;
        x1 = x0 + width;
        y1 = y0 + height;
        z = -dot(d, to_double(light.normal));
        const auto corner = [this](double x, double y) {
            return std::complex<double>(z * std::sqrt(x * x + y * y + z * z), x * y);
        };
        // γ2 + γ3 − π and γ0 + γ1 − π, each from one product.
        const double left = argument(std::conj(corner(x0, y1)), corner(x0, y0));
        const double right = argument(std::conj(corner(x1, y0)), corner(x1, y1));
        k = std::numbers::pi - left;
        solid_angle = left + right;
    }

    static double argument(std::complex<double> a, std::complex<double> b) {
        return std::atan2(a.real() * b.imag() + a.imag() * b.real(),
                          a.real() * b.real() - a.imag() * b.imag());
    }

    Vec2f sample(Vec2f u) const {
        const double b0 = -y0 / std::sqrt(y0 * y0 + z * z), b1 = y1 / std::sqrt(y1 * y1 + z * z);
        const double a = u.x * solid_angle + k;
        const double f = (std::cos(a) * b0 - b1) / std::sin(a);
        const double x = std::clamp(
            std::copysign(z / std::sqrt(std::max(f * f + b0 * b0 - 1, 1e-300)), f), x0, x1);
        const double d = std::sqrt(x * x + z * z);
        const double h0 = y0 / std::sqrt(d * d + y0 * y0), h1 = y1 / std::sqrt(d * d + y1 * y1);
        const double h = h0 + u.y * (h1 - h0);
        const double y = std::clamp(h * d / std::sqrt(std::max(1 - h * h, 1e-300)), y0, y1);
        return {static_cast<float>((x - x0) / (x1 - x0)), static_cast<float>((y - y0) / (y1 - y0))};
    }

    // cosθ / (Ω d²).
    double pdf(Vec2f uv) const {
        const double x = x0 + uv.x * (x1 - x0), y = y0 + uv.y * (y1 - y0);
        const double d2 = x * x + y * y + z * z;
        return solid_angle > 0 ? z / (solid_angle * d2 * std::sqrt(d2)) : 0;
    }
};

bool is_behind(const RectLight& light, Vec3f reference) {
    return !(dot(reference - light.corner, light.normal) > 0);
}

bool is_near(const RectLight& light, Vec3f reference) {
    const Vec3f diagonal = light.edge_u + light.edge_v;
    const Vec3f center = light.corner + diagonal * 0.5f;
    return light.rectangular &&
           length_squared(reference - center) < sqr(near_in_diagonals) * length_squared(diagonal);
}

}  // namespace

RectLight::RectLight(const Affine3f& transform, float width, float height)
    : corner(transform.point({-0.5f * width, -0.5f * height, 0})),
      edge_u(transform.vector({width, 0, 0})),
      edge_v(transform.vector({0, height, 0})) {
    const Vec3d u = to_double(edge_u), v = to_double(edge_v), n = cross(u, v);
    const double n2 = dot(n, n);
    area = std::sqrt(n2);
    if (!(area > 0)) return;
    normal = normalize(transform.normal({0, 0, -1}));
    dual_u = cross(v, n) * (1 / n2);
    dual_v = cross(n, u) * (1 / n2);
    rectangular = std::fabs(dot(u, v)) <= 1e-5 * length(u) * length(v);
}

LightPoint surface_point(const RectLight& light, Vec2f uv) {
    LightPoint point;
    point.position = light.corner + light.edge_u * uv.x + light.edge_v * uv.y;
    point.normal = light.normal;
    point.uv = uv;
    return point;
}

// The image's left edge is at local +x and its top at +y: upright to a viewer in front of it. The
// image ends at its edges, whatever the texture's wrap modes.
Spectrum surface_radiance(const RectLight& light, Vec2f uv) {
    if (!light.texture) return light.radiance;
    const float half_s = 0.5f / static_cast<float>(light.texture->width);
    const float half_t = 0.5f / static_cast<float>(light.texture->height);
    const Texel t = light.texture->lookup(
        {std::clamp(1 - uv.x, half_s, 1 - half_s), std::clamp(uv.y, half_t, 1 - half_t)});
    return light.radiance * Spectrum(t[0], t[1], t[2]);
}

bool sample_area(const RectLight& light, Vec2f u, Vec2f& uv, double& pdf) {
    uv = u;
    pdf = 1 / light.area;
    return true;
}

double pdf_area(const RectLight& light, Vec2f) { return 1 / light.area; }

bool sample_toward(const RectLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf) {
    if (is_behind(light, reference)) return false;
    if (!is_near(light, reference)) return sample_area(light, u, uv, pdf);
    const SphericalRectangle seen(light, reference);
    uv = seen.sample(u);
    pdf = seen.pdf(uv);
    return pdf > 0;
}

double pdf_toward(const RectLight& light, Vec3f reference, Vec2f uv) {
    if (is_behind(light, reference)) return 0;
    return is_near(light, reference) ? SphericalRectangle(light, reference).pdf(uv)
                                     : pdf_area(light, uv);
}

double projected_area(const RectLight& light, Vec3d direction) {
    return light.area * std::max(dot(to_double(light.normal), direction), 0.0);
}

bool intersect(const RectLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv) {
    const Vec3d n = to_double(light.normal), d = to_double(direction);
    const Vec3d from_corner = to_double(origin) - to_double(light.corner);
    const double distance = -dot(from_corner, n) / dot(d, n);
    if (!(distance > tnear && distance < tfar)) return false;
    const Vec3d p = from_corner + d * distance;
    const double u = dot(p, light.dual_u), v = dot(p, light.dual_v);
    if (!(u >= 0 && u <= 1 && v >= 0 && v <= 1)) return false;
    t = static_cast<float>(distance);
    uv = {static_cast<float>(u), static_cast<float>(v)};
    return true;
}

void bounds(const RectLight& light, Vec3f& lower, Vec3f& upper) {
    const Vec3f a = light.corner, b = a + light.edge_u, c = a + light.edge_v, d = b + light.edge_v;
    lower = min(min(a, b), min(c, d));
    upper = max(max(a, b), max(c, d));
}

}  // namespace usdmlt
