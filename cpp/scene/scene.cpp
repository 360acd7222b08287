#include "scene/scene.hpp"

#include <algorithm>

namespace usdmlt {
namespace {

// Meshes placed in the world or instanced may emit: one light per placement.
void add_mesh_lights(Scene& scene) {
    const auto emits = [&](const Mesh& mesh) {
        if (mesh.triangle_materials.empty()) return is_emissive(scene.materials, mesh.material);
        return std::any_of(mesh.triangle_materials.begin(), mesh.triangle_materials.end(),
                           [&](uint32_t m) { return is_emissive(scene.materials, m); });
    };
    scene.mesh_lights.assign(scene.world_meshes, invalid_index);
    for (uint32_t i = 0; i < scene.world_meshes; ++i)
        if (emits(scene.meshes[i]))
            scene.mesh_lights[i] =
                add_mesh(scene.lights, scene.meshes[i], Affine3f{}, {}, scene.materials);

    scene.emissive_rank.assign(scene.meshes.size(), invalid_index);
    std::vector<std::vector<uint32_t>> emitters(scene.prototypes.size());
    for (size_t p = 0; p < scene.prototypes.size(); ++p)
        for (uint32_t i = 0; i < scene.prototypes[p].count; ++i) {
            const uint32_t mesh = scene.prototypes[p].first + i;
            if (!emits(scene.meshes[mesh])) continue;
            scene.emissive_rank[mesh] = static_cast<uint32_t>(emitters[p].size());
            emitters[p].push_back(mesh);
        }
    scene.instance_first_light.assign(scene.instances.size(), invalid_index);
    for (size_t i = 0; i < scene.instances.size(); ++i)
        for (const uint32_t mesh : emitters[scene.instances[i].prototype]) {
            const uint32_t light =
                add_mesh(scene.lights, scene.meshes[mesh], scene.instances[i].to_world,
                         scene.instances[i].later(scene.instance_steps), scene.materials);
            if (scene.instance_first_light[i] == invalid_index)
                scene.instance_first_light[i] = light;
        }
}

ShapeCallbacks light_shapes(const Lights& lights) {
    ShapeCallbacks shapes;
    shapes.user = &lights;
    shapes.count = static_cast<uint32_t>(shape_count(lights));
    shapes.flat = [](const void* user, uint32_t shape, Parallelogram& out) {
        return flat_shape(*static_cast<const Lights*>(user), static_cast<int>(shape), out);
    };
    shapes.bounds = [](const void* user, uint32_t shape, Vec3f& lower, Vec3f& upper) {
        shape_bounds(*static_cast<const Lights*>(user), static_cast<int>(shape), lower, upper);
    };
    shapes.intersect = [](const void* user, uint32_t shape, Vec3f origin, Vec3f direction,
                          float time, float tnear, float tfar, float& t, Vec2f& uv) {
        return intersect_shape(*static_cast<const Lights*>(user), static_cast<int>(shape), origin,
                               direction, time, tnear, tfar, t, uv);
    };
    return shapes;
}

}  // namespace

void Scene::commit(const std::shared_ptr<const embree::Library>& library, const std::string& isa) {
    all_whole = std::all_of(materials.materials.begin(), materials.materials.end(),
                            [](const Material& m) { return m.is_opaque; });
    all_opaque =
        all_whole &&
        std::none_of(meshes.begin(), meshes.end(), [](const Mesh& m) { return m.one_sided; }) &&
        !media.nested;
    add_mesh_lights(*this);
    has_motion =
        camera.moves() ||
        std::any_of(meshes.begin(), meshes.end(), [](const Mesh& m) { return m.moves(); }) ||
        !instance_steps.empty() || !lights.motions.empty();
    acceleration = std::make_unique<Acceleration>(library, isa, meshes, world_meshes, prototypes,
                                                  instances, instance_steps, light_shapes(lights));
    media.commit(library, isa);
    // The sphere that bounds everything: infinite lights shine from a disk of its size. The camera
    // is inside, so that fog or a lens in empty space is lit alike.
    Vec3f lower, upper;
    acceleration->bounds(lower, upper);
    for (const Mesh& boundary : media.boundaries)
        for (const Vec3f& p : boundary.positions) {
            lower = min(lower, p);
            upper = max(upper, p);
        }
    if (lower.x > upper.x) lower = upper = camera.poses[0].position;
    for (const CameraPose& pose : camera.poses) {
        lower = min(lower, pose.position);
        upper = max(upper, pose.position);
    }
    const Vec3f center = (lower + upper) * 0.5f;
    radius = std::max(length(upper - center) * 1.001f, 1e-20f);
    lights.finish(center, radius);
}

}  // namespace usdmlt
