#include "lights/mesh_light.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace usdmlt {

namespace {

// Average importance of a triangle's emission, over the centres of the n² congruent triangles that
// it divides into.
double average_emission(const MeshLight& light, uint32_t triangle, int n) {
    double sum = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < 2 * (n - i) - 1; ++j) {
            const bool upright = j % 2 == 0;
            const float b1 = (static_cast<float>(i) + (upright ? 1 : 2) / 3.0f) / n;
            const float b2 = (static_cast<float>(j / 2) + (upright ? 1 : 2) / 3.0f) / n;
            sum += importance(surface_radiance(light, triangle, {b1, b2}));
        }
    return sum / sqr(double(n));
}

}  // namespace

MeshLight::MeshLight(const Mesh& mesh, const Affine3f& to_world, std::span<const Affine3f> later,
                     const Materials& materials)
    : mesh(&mesh), materials(&materials), to_world(to_world), later(later) {
    const auto material = [&](uint32_t i) -> const Material& {
        return materials.materials[mesh.material_of(i)];
    };
    const auto count = static_cast<uint32_t>(mesh.triangles.size());
    for (uint32_t i = 0; i < count; ++i)
        if (material(i).is_emissive && triangle_area(*this, i, 0) > 0) triangles.push_back(i);
    if (triangles.empty()) return;

    // Few triangles may each show much of a texture: about 20 000 lookups in all.
    const int n =
        std::clamp(static_cast<int>(std::sqrt(20000.0 / double(triangles.size()))), 2, 64);
    std::vector<double> emission;
    double total_area = 0, total_flux = 0;
    for (const uint32_t i : triangles) {
        emission.push_back(average_emission(*this, i, material(i).is_constant ? 1 : n));
        const double area = triangle_area(*this, i, 0);
        total_area += area;
        total_flux += area * emission.back();
    }
    // A texture's highlight may hide between the lookups: no triangle of varying emission is
    // chosen much more rarely than its area asks for.
    const double least = 0.05 * total_flux / total_area;
    for (size_t k = 0; k < triangles.size(); ++k) {
        const double value =
            material(triangles[k]).is_constant ? emission[k] : std::max(emission[k], least);
        flux.push_back(2 * std::numbers::pi * triangle_area(*this, triangles[k], 0) * value);
    }
}

LightPoint surface_point(const MeshLight& light, uint32_t triangle, Vec2f uv, float time) {
    const Mesh& mesh = *light.mesh;
    const Vec3f a = mesh.corner(triangle, 0, time), b = mesh.corner(triangle, 1, time),
                c = mesh.corner(triangle, 2, time);
    const Affine3f to_world = transform_at(light.to_world, light.later, time);
    LightPoint point;
    point.position = to_world.point(a * (1 - uv.x - uv.y) + b * uv.x + c * uv.y);
    point.normal = normalize(to_world.normal(cross(b - a, c - a)));
    point.time = time;
    point.uv = uv;
    point.primitive = triangle;
    return point;
}

Spectrum surface_radiance(const MeshLight& light, uint32_t triangle, Vec2f uv) {
    return emission(*light.materials, light.mesh->material_of(triangle), *light.mesh, triangle,
                    uv.x, uv.y);
}

double triangle_area(const MeshLight& light, uint32_t triangle, float time) {
    const Affine3f to_world = transform_at(light.to_world, light.later, time);
    const Vec3f a = light.mesh->corner(triangle, 0, time);
    const Vec3f ab = to_world.vector(light.mesh->corner(triangle, 1, time) - a);
    const Vec3f ac = to_world.vector(light.mesh->corner(triangle, 2, time) - a);
    return 0.5 * length(cross(to_double(ab), to_double(ac)));
}

uint32_t emitter_index(const MeshLight& light, uint32_t triangle) {
    const std::vector<uint32_t>& all = light.triangles;
    // Mostly all triangles of a mesh emit.
    if (triangle < all.size() && all[triangle] == triangle) return triangle;
    const auto it = std::lower_bound(all.begin(), all.end(), triangle);
    return it != all.end() && *it == triangle ? static_cast<uint32_t>(it - all.begin())
                                              : invalid_index;
}

}  // namespace usdmlt
