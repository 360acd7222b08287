// Points of lights that rays find.
#include <utility>

#include "lights/lights.hpp"

namespace usdmlt {

namespace {

// Calls f with the shape; every entry of `shapes` is one.
template <typename F>
auto visit_shape(const Lights& lights, int shape, const F& f) {
    return std::visit(
        [&]<typename L>(const L& light) {
            if constexpr (Shape<L>)
                return f(light);
            else
                return decltype(f(std::declval<const RectLight&>()))();
        },
        lights.lights[lights.shapes[shape]]);
}

}  // namespace

bool environment_point(const Lights& lights, Vec3f direction, float time, LightPoint& point) {
    if (lights.environment.empty()) return false;
    point = {};
    point.direction = direction;
    point.light = environment_light;
    point.infinite = true;
    point.time = time;
    return true;
}

int shape_count(const Lights& lights) { return static_cast<int>(lights.shapes.size()); }

void shape_bounds(const Lights& lights, int shape, Vec3f& lower, Vec3f& upper) {
    visit_shape(lights, shape, [&](const auto& light) { bounds(light, lower, upper); });
    const uint32_t motion = lights.motion_of_light[lights.shapes[shape]];
    if (motion != invalid_index) {
        // However it turns, it stays as near to its place.
        const std::vector<Affine3f>& steps = lights.motions[motion].steps;
        const Vec3f pivot = steps[0].origin;
        const float reach = length(max(upper - pivot, pivot - lower));
        lower = upper = pivot;
        for (const Affine3f& step : steps) {
            lower = min(lower, step.origin);
            upper = max(upper, step.origin);
        }
        lower = lower - Vec3f{reach, reach, reach};
        upper = upper + Vec3f{reach, reach, reach};
    }
    // Room for the rounding of positions.
    const Vec3f largest = max(max(lower, -lower), max(upper, -upper));
    const Vec3f margin = largest * 1e-6f;
    lower = lower - margin;
    upper = upper + margin;
}

bool flat_shape(const Lights& lights, int shape, Parallelogram& out) {
    const uint32_t light = lights.shapes[shape];
    if (lights.motion_of_light[light] != invalid_index) return false;
    if (const auto* rect = std::get_if<RectLight>(&lights.lights[light])) {
        out = {rect->corner, rect->edge_u, rect->edge_v, false};
        return true;
    }
    if (const auto* disk = std::get_if<DiskLight>(&lights.lights[light])) {
        out = {disk->center - disk->axis_u - disk->axis_v, disk->axis_u * 2, disk->axis_v * 2,
               true};
        return true;
    }
    return false;
}

bool intersect_shape(const Lights& lights, int shape, Vec3f origin, Vec3f direction, float time,
                     float tnear, float tfar, float& t, Vec2f& uv) {
    const LightPose pose = lights.pose(lights.shapes[shape], time);
    origin = pose.point_to_opening(origin);
    direction = pose.to_opening(direction);
    return visit_shape(lights, shape, [&](const auto& light) {
        return intersect(light, origin, direction, tnear, tfar, t, uv);
    });
}

LightPoint shape_point(const Lights& lights, int shape, Vec2f uv, float time) {
    LightPoint point =
        visit_shape(lights, shape, [&](const auto& light) { return surface_point(light, uv); });
    point.light = lights.shapes[shape];
    const LightPose pose = lights.pose(point.light, time);
    point.position = pose.point(point.position);
    point.normal = pose.vector(point.normal);
    point.time = time;
    return point;
}

LightPoint mesh_point(const Lights& lights, uint32_t light, uint32_t triangle, float b1, float b2,
                      float time) {
    LightPoint point =
        surface_point(std::get<MeshLight>(lights.lights[light]), triangle, {b1, b2}, time);
    point.light = light;
    return point;
}

}  // namespace usdmlt
