#include "lights/lights.hpp"

#include <cmath>
#include <numbers>
#include <span>

namespace usdmlt {

namespace {

bool is_dirac(const DistantLight& light) { return light.delta; }
bool is_dirac(const DomeLight&) { return false; }

// Average of the texture that multiplies the radiance.
Spectrum average_color(const RectLight& light) {
    if (!light.texture) return Spectrum(1.0f);
    const int w = light.texture->width, h = light.texture->height;
    double sum[3] = {0, 0, 0};
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
            const Texel t = light.texture->texel(x, y);
            for (int i = 0; i < 3; ++i)
                if (std::isfinite(t[i])) sum[i] += std::fabs(t[i]) / (double(w) * h);
        }
    return {static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])};
}
template <Shape L>
Spectrum average_color(const L&) {
    return Spectrum(1.0f);
}

// Φ = ∫ importance(L S(θ)) A⊥(ω) dω over the directions ω that the shaping lets through, A⊥ the
// area that faces ω: midpoints in θ and φ. Without shaping ∫ A⊥ dω = πA (Cauchy).
template <Shape L>
double flux(const L& light) {
    const Spectrum color = light.radiance * average_color(light);
    if (!light.shaping.active()) return std::numbers::pi * light.area * importance(color);
    constexpr int rows = 256, columns = 32;
    const Frame frame = Frame::from_normal(light.shaping.axis());
    const double width = light.shaping.angle() / double(rows);
    double sum = 0;
    for (int j = 0; j < rows; ++j) {
        const double theta = (j + 0.5) * width, sine = std::sin(theta);
        const auto direction = [&](double phi) {
            return frame.to_world(
                to_float({sine * std::cos(phi), sine * std::sin(phi), std::cos(theta)}));
        };
        for (int i = 0; i < columns; ++i) {
            const Vec3f d = direction(2 * std::numbers::pi * (i + 0.5) / columns);
            sum += importance(color * light.shaping.evaluate(d)) * sine *
                   projected_area(light, to_double(d));
        }
    }
    return sum * width * 2 * std::numbers::pi / columns;
}

uint32_t add(Lights& lights, Light&& light) {
    lights.lights.push_back(std::move(light));
    lights.links.of_light.push_back(invalid_index);
    lights.motion_of_light.push_back(invalid_index);
    return static_cast<uint32_t>(lights.lights.size() - 1);
}

template <Shape L>
uint32_t add_shape(Lights& lights, L&& light, const Affine3f& transform, const Spectrum& radiance,
                   const ShapingParameters* shaping) {
    light.radiance = radiance;
    if (shaping) {
        const Vec3f axis = normalize(transform.vector({0, 0, -1}));
        bool flat = false;
        if constexpr (requires { light.normal; }) flat = dot(light.normal, axis) > 0.9999f;
        light.shaping = Shaping(*shaping, transform, flat);
    }
    const uint32_t index = add(lights, std::move(light));
    lights.shapes.push_back(index);
    return index;
}

}  // namespace

uint32_t add_rect(Lights& lights, const Affine3f& transform, float width, float height,
                  const Spectrum& radiance, const Texture* texture,
                  const ShapingParameters* shaping) {
    RectLight light(transform, width, height);
    light.texture = texture;
    return add_shape(lights, std::move(light), transform, radiance, shaping);
}

uint32_t add_disk(Lights& lights, const Affine3f& transform, float radius, const Spectrum& radiance,
                  const ShapingParameters* shaping) {
    return add_shape(lights, DiskLight(transform, radius), transform, radiance, shaping);
}

uint32_t add_sphere(Lights& lights, const Affine3f& transform, float radius,
                    const Spectrum& radiance, const ShapingParameters* shaping) {
    return add_shape(lights, SphereLight(transform, radius), transform, radiance, shaping);
}

uint32_t add_cylinder(Lights& lights, const Affine3f& transform, float radius, float length,
                      const Spectrum& radiance, const ShapingParameters* shaping) {
    return add_shape(lights, CylinderLight(transform, radius, length), transform, radiance,
                     shaping);
}

uint32_t add_distant(Lights& lights, const Affine3f& transform, float angle_degrees,
                     const Spectrum& radiance) {
    DistantLight light(transform, angle_degrees);
    light.radiance = radiance;
    return add(lights, std::move(light));
}

uint32_t add_dome(Lights& lights, const Affine3f& transform, const Spectrum& radiance,
                  const Texture* texture) {
    return add(lights, DomeLight(transform, radiance, texture));
}

void set_motion(Lights& lights, uint32_t light, const Affine3f& transform,
                const std::vector<Affine3f>& later) {
    if (later.empty()) return;
    lights.motion_of_light[light] = static_cast<uint32_t>(lights.motions.size());
    lights.motions.emplace_back(transform, later);
}

uint32_t add_mesh(Lights& lights, const Mesh& mesh, const Affine3f& to_world,
                  std::span<const Affine3f> later, const Materials& materials) {
    const uint32_t index = add(lights, MeshLight(mesh, to_world, later, materials));
    lights.links.of_light[index] = mesh.link;
    return index;
}

void Lights::finish(Vec3f center, float radius) {
    scene_center = center;
    scene_radius = radius > 0 ? radius * 1.0001f : 1.0f;  // origins on the disk are outside
    const double disk = std::numbers::pi * sqr(double(scene_radius));

    std::vector<double> weights, environment_weights;
    const auto choose = [&](uint32_t light, uint32_t primitive, double weight) {
        choices.push_back({light, primitive});
        weights.push_back(std::isfinite(weight) ? weight : 0);
        return weights.back();
    };
    double environment_power = 0;
    for (uint32_t i = 0; i < lights.size(); ++i) {
        first_choice.push_back(static_cast<uint32_t>(choices.size()));
        std::visit(
            [&]<typename L>(const L& light) {
                if constexpr (Shape<L>) {
                    power.push_back(choose(i, 0, flux(light)));
                } else if constexpr (Infinite<L>) {
                    const double value = disk * importance(integrated_radiance(light));
                    power.push_back(std::isfinite(value) ? value : 0);
                    if (is_dirac(light)) {
                        choose(i, 0, value);
                    } else if (power.back() > 0) {
                        environment.push_back(i);
                        environment_weights.push_back(value);
                        environment_power += value;
                    }
                } else {
                    power.push_back(0);
                    for (size_t k = 0; k < light.triangles.size(); ++k)
                        power.back() += choose(i, light.triangles[k], light.flux[k]);
                }
            },
            lights[i]);
    }
    choose(environment_light, 0, environment_power);
    selection = DiscreteDistribution(weights);
    environment_selection = DiscreteDistribution(environment_weights);
    if (!selection.empty()) environment_probability = selection.probability(choices.size() - 1);
}

}  // namespace usdmlt
