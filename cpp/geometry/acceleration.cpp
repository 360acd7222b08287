#include "geometry/acceleration.hpp"

#include <limits>
#include <stdexcept>

namespace usdmlt {
namespace {

void shape_bounds(const embree::BoundsFunctionArguments* args) {
    const auto& called = *static_cast<const CalledShapes*>(args->geometry_user_pointer);
    Vec3f lower, upper;
    called.shapes.bounds(called.shapes.user, called.index[args->prim_id], lower, upper);
    *args->bounds = {lower.x, lower.y, lower.z, 0, upper.x, upper.y, upper.z, 0};
}

bool intersects(const CalledShapes& called, unsigned i, const embree::Ray& ray, float& t,
                Vec2f& uv) {
    return called.shapes.intersect(
        called.shapes.user, called.index[i], {ray.org_x, ray.org_y, ray.org_z},
        {ray.dir_x, ray.dir_y, ray.dir_z}, ray.time, ray.tnear, ray.tfar, t, uv);
}

void shape_intersect(const embree::IntersectFunctionArguments* args) {
    if (args->valid[0] != -1) return;
    const auto& called = *static_cast<const CalledShapes*>(args->geometry_user_pointer);
    embree::Ray& ray = args->ray_hit->ray;
    float t;
    Vec2f uv;
    if (!intersects(called, args->prim_id, ray, t, uv)) return;
    ray.tfar = t;
    embree::Hit& hit = args->ray_hit->hit;
    hit.u = uv.x;
    hit.v = uv.y;
    hit.prim_id = args->prim_id;
    hit.geom_id = args->geom_id;
    hit.inst_id = args->context->inst_id;
    hit.inst_prim_id = args->context->inst_prim_id;
}

void shape_occluded(const embree::OccludedFunctionArguments* args) {
    if (args->valid[0] != -1) return;
    const auto& called = *static_cast<const CalledShapes*>(args->geometry_user_pointer);
    embree::Ray& ray = *args->ray;
    float t;
    Vec2f uv;
    if (intersects(called, args->prim_id, ray, t, uv))
        ray.tfar = -std::numeric_limits<float>::infinity();
}

// Passes what is beside the ellipse.
void ellipse_filter(const embree::FilterFunctionArguments* args) {
    if (args->valid[0] != -1) return;
    const embree::Hit& hit = *args->hit;
    const Vec2f p = FlatShapes::parameters(hit.prim_id, hit.u, hit.v);
    if (!(sqr(2 * p.x - 1) + sqr(2 * p.y - 1) <= 1)) args->valid[0] = 0;
}

}  // namespace

void FlatShapes::add(uint32_t shape, const Parallelogram& p) {
    for (const Vec3f corner :
         {p.corner, p.corner + p.edge_u, p.corner + p.edge_v, p.corner + p.edge_u + p.edge_v})
        mesh.positions.push_back(corner);
    index.push_back(shape);
}

void Acceleration::attach_flat(FlatShapes& shapes, embree::FilterFunction filter) {
    if (shapes.index.empty()) return;
    shapes.mesh.positions.reserve(shapes.mesh.positions.size() + 1);  // Embree reads 16 bytes
    std::vector<Triangle> triangles;
    for (uint32_t v = 0; v < shapes.mesh.positions.size(); v += 4) {
        triangles.push_back({v, v + 1, v + 2});
        triangles.push_back({v + 3, v + 2, v + 1});
    }
    shapes.mesh.triangles = std::move(triangles);
    const embree::Geometry geometry = new_triangles(shapes.mesh);
    if (filter) {
        library_->rtcSetGeometryIntersectFilterFunction(geometry, filter);
        library_->rtcSetGeometryOccludedFilterFunction(geometry, filter);
        library_->rtcCommitGeometry(geometry);
    }
    shapes.geometry = attach(scene_.get(), geometry);
    ++first_instance_;
}

embree::Geometry Acceleration::new_triangles(const Mesh& mesh) const {
    const embree::Geometry geometry =
        library_->rtcNewGeometry(device_.get(), embree::triangle_geometry);
    const auto set_positions = [&](unsigned step, const std::vector<Vec3f>& positions) {
        library_->rtcSetSharedGeometryBuffer(geometry, embree::vertex_buffer, step,
                                             embree::format_float3, positions.data(), 0,
                                             sizeof(Vec3f), positions.size());
    };
    if (mesh.moves())
        library_->rtcSetGeometryTimeStepCount(
            geometry, static_cast<unsigned>(mesh.later_positions.size() + 1));
    set_positions(0, mesh.positions);
    for (size_t i = 0; i < mesh.later_positions.size(); ++i)
        set_positions(static_cast<unsigned>(i + 1), mesh.later_positions[i]);
    library_->rtcSetSharedGeometryBuffer(geometry, embree::index_buffer, 0, embree::format_uint3,
                                         mesh.triangles.data(), 0, sizeof(Triangle),
                                         mesh.triangles.size());
    library_->rtcCommitGeometry(geometry);
    return geometry;
}

Acceleration::Acceleration(std::shared_ptr<const embree::Library> library, const std::string& isa,
                           const std::vector<Mesh>& meshes, uint32_t world_meshes,
                           const std::vector<MeshRange>& prototypes,
                           const std::vector<Instance>& instances,
                           const std::vector<Affine3f>& instance_steps,
                           const ShapeCallbacks& shapes)
    : library_(std::move(library)),
      device_(embree::new_device(*library_, isa)),
      scene_(nullptr, {library_.get()}),
      world_meshes_(world_meshes) {
    const embree::Library& e = *library_;
    const auto new_scene = [&] {
        const embree::Scene scene = e.rtcNewScene(device_.get());
        // Watertight at shared edges: a chain would find and keep any leak.
        e.rtcSetSceneFlags(scene, embree::scene_flag_robust);
        return embree::ScenePointer(scene, {library_.get()});
    };
    for (const MeshRange& range : prototypes) {
        embree::ScenePointer prototype = new_scene();
        for (uint32_t i = 0; i < range.count; ++i)
            attach(prototype.get(), new_triangles(meshes[range.first + i]));
        e.rtcCommitScene(prototype.get());
        prototype_scenes_.push_back(std::move(prototype));
    }

    scene_ = new_scene();
    for (uint32_t i = 0; i < world_meshes; ++i) attach(scene_.get(), new_triangles(meshes[i]));
    first_instance_ = world_meshes;
    called_ = std::make_unique<CalledShapes>(CalledShapes{shapes, {}});
    for (uint32_t i = 0; i < shapes.count; ++i) {
        Parallelogram flat;
        if (!shapes.flat(shapes.user, i, flat))
            called_->index.push_back(i);
        else
            (flat.ellipse ? ellipses_ : parallelograms_).add(i, flat);
    }
    attach_flat(parallelograms_, nullptr);
    attach_flat(ellipses_, ellipse_filter);
    if (!called_->index.empty()) {
        const embree::Geometry geometry = e.rtcNewGeometry(device_.get(), embree::user_geometry);
        e.rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(called_->index.size()));
        e.rtcSetGeometryUserData(geometry, called_.get());
        e.rtcSetGeometryBoundsFunction(geometry, shape_bounds, nullptr);
        e.rtcSetGeometryIntersectFunction(geometry, shape_intersect);
        e.rtcSetGeometryOccludedFunction(geometry, shape_occluded);
        e.rtcCommitGeometry(geometry);
        attach(scene_.get(), geometry);
        ++first_instance_;
    }
    instance_first_mesh_.reserve(instances.size());
    for (const Instance& instance : instances) {
        const embree::Geometry geometry =
            e.rtcNewGeometry(device_.get(), embree::instance_geometry);
        e.rtcSetGeometryInstancedScene(geometry, prototype_scenes_[instance.prototype].get());
        static_assert(sizeof(Affine3f) == 12 * sizeof(float));
        if (instance.steps > 0) e.rtcSetGeometryTimeStepCount(geometry, instance.steps + 1);
        for (uint32_t step = 0; step <= instance.steps; ++step)
            e.rtcSetGeometryTransform(
                geometry, step, embree::format_float3x4_column_major,
                step == 0 ? &instance.to_world : &instance_steps[instance.first_step + step - 1]);
        e.rtcCommitGeometry(geometry);
        attach(scene_.get(), geometry);
        instance_first_mesh_.push_back(prototypes[instance.prototype].first);
    }
    e.rtcCommitScene(scene_.get());
    if (e.rtcGetDeviceError(device_.get()) != 0)
        throw std::runtime_error("Embree could not build the acceleration structure");
}

void Acceleration::bounds(Vec3f& lower, Vec3f& upper) const {
    embree::Bounds b;
    library_->rtcGetSceneBounds(scene_.get(), &b);
    lower = {b.lower_x, b.lower_y, b.lower_z};
    upper = {b.upper_x, b.upper_y, b.upper_z};
}

}  // namespace usdmlt
