#include "lights/disk.hpp"

#include <cmath>
#include <numbers>

#include "base/warps.hpp"

namespace usdmlt {

namespace {

bool is_behind(const DiskLight& light, Vec3f reference) {
    return !(dot(reference - light.center, light.normal) > 0);
}

}  // namespace

DiskLight::DiskLight(const Affine3f& transform, float radius)
    : center(transform.origin),
      axis_u(transform.vector({radius, 0, 0})),
      axis_v(transform.vector({0, radius, 0})) {
    const Vec3d u = to_double(axis_u), v = to_double(axis_v), n = cross(u, v);
    const double n2 = dot(n, n);
    area = std::numbers::pi * std::sqrt(n2);
    if (!(area > 0)) return;
    normal = normalize(transform.normal({0, 0, -1}));
    dual_u = cross(v, n) * (1 / n2);
    dual_v = cross(n, u) * (1 / n2);
}

LightPoint surface_point(const DiskLight& light, Vec2f uv) {
    LightPoint point;
    point.position = light.center + light.axis_u * uv.x + light.axis_v * uv.y;
    point.normal = light.normal;
    point.uv = uv;
    return point;
}

bool sample_area(const DiskLight& light, Vec2f u, Vec2f& uv, double& pdf) {
    uv = square_to_disk(u);
    pdf = 1 / light.area;
    return true;
}

double pdf_area(const DiskLight& light, Vec2f) { return 1 / light.area; }

bool sample_toward(const DiskLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf) {
    return !is_behind(light, reference) && sample_area(light, u, uv, pdf);
}

double pdf_toward(const DiskLight& light, Vec3f reference, Vec2f uv) {
    return is_behind(light, reference) ? 0 : pdf_area(light, uv);
}

double projected_area(const DiskLight& light, Vec3d direction) {
    return light.area * std::max(dot(to_double(light.normal), direction), 0.0);
}

bool intersect(const DiskLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv) {
    const Vec3d n = to_double(light.normal), d = to_double(direction);
    const Vec3d from_center = to_double(origin) - to_double(light.center);
    const double distance = -dot(from_center, n) / dot(d, n);
    if (!(distance > tnear && distance < tfar)) return false;
    const Vec3d p = from_center + d * distance;
    const double u = dot(p, light.dual_u), v = dot(p, light.dual_v);
    if (!(u * u + v * v <= 1)) return false;
    t = static_cast<float>(distance);
    uv = {static_cast<float>(u), static_cast<float>(v)};
    return true;
}

// The extent of an ellipse along an axis is the norm of its two half-axes' components there.
void bounds(const DiskLight& light, Vec3f& lower, Vec3f& upper) {
    const Vec3f u = light.axis_u, v = light.axis_v;
    const Vec3f extent{std::hypot(u.x, v.x), std::hypot(u.y, v.y), std::hypot(u.z, v.z)};
    lower = light.center - extent;
    upper = light.center + extent;
}

}  // namespace usdmlt
