// x0: samples and densities of light points.
#include <cmath>
#include <type_traits>

#include "lights/lights.hpp"

namespace usdmlt {

namespace {

Vec2f square_to_barycentrics(Vec2f u) {
    const float r = std::sqrt(u.x);
    return {r * (1 - u.y), r * u.y};
}

// Σ over the environment's lights; `light.environment_selection` weighs their densities.
double pdf_environment(const Lights& lights, Vec3f direction, float time) {
    double pdf = 0;
    for (size_t k = 0; k < lights.environment.size(); ++k)
        std::visit(
            [&]<typename L>(const L& light) {
                if constexpr (Infinite<L>)
                    pdf +=
                        lights.environment_selection.probability(k) *
                        pdf_incoming(
                            light, lights.pose(lights.environment[k], time).to_opening(direction));
            },
            lights.lights[lights.environment[k]]);
    return lights.environment_probability * pdf;
}

bool sample_environment(const Lights& lights, double u_select, Vec2f u, float time,
                        LightPoint& point, double& pdf) {
    double probability;
    const size_t k = lights.environment_selection.sample(u_select, probability);
    point = {};
    point.light = environment_light;
    point.infinite = true;
    point.time = time;
    std::visit(
        [&]<typename L>(const L& light) {
            if constexpr (Infinite<L>) point.direction = sample_incoming(light, u);
        },
        lights.lights[lights.environment[k]]);
    point.direction = lights.pose(lights.environment[k], time).vector(point.direction);
    pdf = pdf_environment(lights, point.direction, time);
    return pdf > 0;
}

// With or without a reference point.
bool sample_x0(const Lights& lights, const Vec3f* reference, float u_select, Vec2f u, float time,
               LightPoint& point, double& pdf) {
    if (lights.empty()) return false;
    double u_choice = u_select, probability = 1;
    size_t c = 0;
    if (lights.choices.size() > 1) {
        u_choice = extend_uniform(u_select, u);
        c = lights.selection.sample(u_choice, probability);
    }
    const Lights::Choice choice = lights.choices[c];
    if (choice.light == environment_light)
        return sample_environment(lights, u_choice, u, time, point, pdf);
    const LightPose pose = lights.pose(choice.light, time);

    const bool found = std::visit(
        [&]<typename L>(const L& light) {
            if constexpr (Shape<L>) {
                Vec2f uv;
                if (!(reference
                          ? sample_toward(light, pose.point_to_opening(*reference), u, uv, pdf)
                          : sample_area(light, u, uv, pdf)))
                    return false;
                point = surface_point(light, uv);
                point.position = pose.point(point.position);
                point.normal = pose.vector(point.normal);
                pdf *= probability;
            } else if constexpr (std::is_same_v<L, DistantLight>) {
                point = {};
                point.direction = pose.vector(light.frame.z);
                point.infinite = point.delta = true;
                pdf = probability;
            } else if constexpr (std::is_same_v<L, MeshLight>) {
                point = surface_point(light, choice.primitive, square_to_barycentrics(u), time);
                pdf = probability / triangle_area(light, choice.primitive, time);
            } else {
                return false;  // a dome: part of the environment
            }
            return true;
        },
        lights.lights[choice.light]);
    point.light = choice.light;
    point.time = time;
    return found;
}

double pdf_x0(const Lights& lights, const Vec3f* reference, const LightPoint& point) {
    if (lights.empty()) return 0;
    if (point.light == environment_light)
        return pdf_environment(lights, point.direction, point.time);
    const auto probability = [&](uint32_t offset) {
        return lights.selection.probability(lights.first_choice[point.light] + offset);
    };
    return std::visit(
        [&]<typename L>(const L& light) {
            if constexpr (Shape<L>) {
                if (!reference) return probability(0) * pdf_area(light, point.uv);
                const LightPose pose = lights.pose(point.light, point.time);
                return probability(0) *
                       pdf_toward(light, pose.point_to_opening(*reference), point.uv);
            } else if constexpr (Infinite<L>) {
                return probability(0);
            } else {
                const uint32_t emitter = emitter_index(light, point.primitive);
                if (emitter == invalid_index) return 0.0;
                return probability(emitter) / triangle_area(light, point.primitive, point.time);
            }
        },
        lights.lights[point.light]);
}

}  // namespace

bool sample_point(const Lights& lights, float u_select, Vec2f u, float time, LightPoint& point,
                  double& pdf) {
    return sample_x0(lights, nullptr, u_select, u, time, point, pdf);
}

double pdf_point(const Lights& lights, const LightPoint& point) {
    return pdf_x0(lights, nullptr, point);
}

bool sample_direct(const Lights& lights, Vec3f reference, float u_select, Vec2f u, float time,
                   LightPoint& point, double& pdf) {
    return sample_x0(lights, &reference, u_select, u, time, point, pdf);
}

double pdf_direct(const Lights& lights, const LightPoint& point, Vec3f reference) {
    return pdf_x0(lights, &reference, point);
}

}  // namespace usdmlt
