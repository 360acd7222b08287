// Radiance that leaves a light point, and the first edge of a light subpath.
#include <cmath>
#include <numbers>
#include <type_traits>

#include "base/warps.hpp"
#include "lights/lights.hpp"

namespace usdmlt {

namespace {

// Density of directions about the normal: cosθ/π on one side, half of it on each of two; and the
// shaping's own with its share.
template <typename L>
double pdf_leaving(const L& light, Vec3f normal, Vec3f direction) {
    const double cosine = dot(normal, direction);
    if constexpr (!Shape<L>) {
        return std::fabs(cosine) * (0.5 / std::numbers::pi);
    } else {
        if (!(cosine > 0)) return 0;
        const double by_cosine = cosine / std::numbers::pi;
        if (!light.shaping.active()) return by_cosine;
        const double share = light.shaping.share();
        return share * light.shaping.pdf(direction) + (1 - share) * by_cosine;
    }
}

}  // namespace

Spectrum environment_radiance(const Lights& lights, uint32_t light, const LightPoint& point,
                              uint32_t receiver) {
    if (!lights.links.illuminates(light, receiver)) return {};
    const Vec3f incoming = lights.pose(light, point.time).to_opening(point.direction);
    return std::visit(
        [&]<typename L>(const L& one) {
            if constexpr (Infinite<L>)
                return incoming_radiance(one, incoming);
            else
                return Spectrum();
        },
        lights.lights[light]);
}

Spectrum radiance(const Lights& lights, const LightPoint& point, Vec3f direction,
                  uint32_t receiver) {
    if (point.light == environment_light) {
        Spectrum sum;
        for (const uint32_t index : lights.environment)
            sum += environment_radiance(lights, index, point, receiver);
        return sum;
    }
    if (!lights.links.illuminates(point.light, receiver)) return {};
    return std::visit(
        [&]<typename L>(const L& light) {
            if constexpr (Shape<L>) {
                if (!(dot(point.normal, direction) > 0)) return Spectrum(0.0f);
                Spectrum value = light.radiance;
                if constexpr (std::is_same_v<L, RectLight>)
                    value = surface_radiance(light, point.uv);
                if (!light.shaping.active()) return value;
                const LightPose pose = lights.pose(point.light, point.time);
                return value * light.shaping.evaluate(pose.to_opening(direction));
            } else if constexpr (Infinite<L>) {
                return light.radiance;
            } else {
                return surface_radiance(light, point.primitive, point.uv);
            }
        },
        lights.lights[point.light]);
}

bool sample_direction(const Lights& lights, const LightPoint& point, Vec2f u, Vec3f& direction,
                      double& pdf) {
    if (point.infinite) return false;
    const LightPose pose = lights.pose(point.light, point.time);
    const Vec3f normal = pose.to_opening(point.normal);
    return std::visit(
        [&]<typename L>(const L& light) {
            const Frame frame = Frame::from_normal(normal);
            if constexpr (Shape<L>) {
                const float share = light.shaping.share();
                if (u.x < share) {
                    direction = light.shaping.sample({u.x / share, u.y});
                } else {
                    u.x = (u.x - share) / (1 - share);
                    direction = frame.to_world(square_to_cosine_hemisphere(u));
                }
            } else {
                const bool front = u.x < 0.5f;
                u.x = 2 * u.x - (front ? 0.0f : 1.0f);
                const Vec3f local = square_to_cosine_hemisphere(u);
                direction = frame.to_world({local.x, local.y, front ? local.z : -local.z});
            }
            pdf = pdf_leaving(light, normal, direction);
            direction = pose.vector(direction);
            return pdf > 0;
        },
        lights.lights[point.light]);
}

double pdf_direction(const Lights& lights, const LightPoint& point, Vec3f direction) {
    if (point.infinite) return 0;
    const LightPose pose = lights.pose(point.light, point.time);
    const Vec3f normal = pose.to_opening(point.normal);
    direction = pose.to_opening(direction);
    return std::visit([&](const auto& light) { return pdf_leaving(light, normal, direction); },
                      lights.lights[point.light]);
}

void sample_origin(const Lights& lights, Vec3f direction, Vec2f u, Vec3f& origin,
                   double& pdf_area) {
    const Vec2f d = square_to_disk(u);
    const Frame frame = Frame::from_normal(direction);
    origin = lights.scene_center + lights.scene_radius * (frame.x * d.x + frame.y * d.y + frame.z);
    pdf_area = pdf_origin(lights);
}

double pdf_origin(const Lights& lights) {
    return 1 / (std::numbers::pi * sqr(double(lights.scene_radius)));
}

}  // namespace usdmlt
