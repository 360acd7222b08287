#include "scene/dirac_content.hpp"

namespace usdmlt {
namespace {

bool has_dirac_lobe(const Closure& closure) {
    for (int i = 0; i < closure.lobe_count; ++i)
        if (closure.lobes[i].delta && !is_black(closure.lobes[i].weight)) return true;
    return false;
}

bool has_dirac_lobe(const Scene& scene, const Mesh& mesh, uint32_t triangle) {
    Closure closure;
    const Vec3f a = mesh.corner(triangle, 0), e1 = mesh.corner(triangle, 1) - a,
                e2 = mesh.corner(triangle, 2) - a, n = cross(e1, e2);
    const float area = length(n);
    closure.geometric_normal = area > 0 ? n * (1 / area) : Vec3f{0, 0, 1};
    closure.shading = Frame::from_normal(closure.geometric_normal);
    evaluate_material(scene.materials, mesh.material_of(triangle), mesh, triangle, 1 / 3.0f,
                      1 / 3.0f, {}, closure);
    return has_dirac_lobe(closure);
}

}  // namespace

std::vector<uint32_t> dirac_lights(const Scene& scene) {
    std::vector<uint32_t> found;
    for (uint32_t i = 0; i < scene.lights.lights.size(); ++i) {
        const auto* light = std::get_if<DistantLight>(&scene.lights.lights[i]);
        if (light && light->delta && scene.lights.power[i] > 0) found.push_back(i);
    }
    return found;
}

std::vector<uint32_t> dirac_materials(const Scene& scene) {
    const size_t count = scene.materials.materials.size();
    std::vector<bool> seen(count), dirac(count);
    const auto look = [&](const Mesh& mesh, uint32_t triangle) {
        const uint32_t material = mesh.material_of(triangle);
        if (seen[material]) return;
        seen[material] = true;
        dirac[material] = has_dirac_lobe(scene, mesh, triangle);
    };
    for (const Mesh& mesh : scene.meshes) {
        const size_t each = mesh.triangle_materials.empty() ? 1 : mesh.triangles.size();
        for (size_t t = 0; t < std::min(each, mesh.triangles.size()); ++t)
            look(mesh, static_cast<uint32_t>(t));
    }
    std::vector<uint32_t> found;
    for (uint32_t i = 0; i < count; ++i)
        if (dirac[i]) found.push_back(i);
    return found;
}

}  // namespace usdmlt
