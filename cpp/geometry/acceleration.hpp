// The acceleration structure: meshes, instanced prototypes and analytic shapes in one Embree scene.
#pragma once

#include <limits>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "base/frame.hpp"
#include "geometry/embree_library.hpp"
#include "geometry/mesh.hpp"
#include "geometry/parallelogram.hpp"

namespace usdmlt {

struct Ray {
    Vec3f origin;
    float tnear = 0;
    Vec3f direction;
    float tfar = 0;
    float time = 0;  // see motion.hpp
};

struct Hit {
    float t;
    float u, v;          // barycentrics of corners 1 and 2, or the parameters of a shape
    uint32_t mesh;       // index into the scene's meshes; invalid_index: an analytic shape
    uint32_t primitive;  // triangle, or the shape's index
    uint32_t instance;   // invalid_index: placed in the world directly
    float time;
};

// Consecutive meshes of the scene that are placed together.
struct MeshRange {
    uint32_t first = 0, count = 0;
};

struct Instance {
    uint32_t prototype = 0;
    Affine3f to_world;        // where it moves: at the shutter's opening
    uint32_t first_step = 0;  // its further transforms, among those of all instances
    uint32_t steps = 0;       // 0: it does not move

    // Of `all_steps`, the transforms of all instances that move at further equidistant times.
    std::span<const Affine3f> later(const std::vector<Affine3f>& all_steps) const {
        return {all_steps.data() + first_step, steps};
    }
};

// Analytic shapes: light shapes, whose sampled points and hit points have to be the same surface.
// Flat ones that stay in their place are triangles among the others; the rest, for which Embree
// walks a tree of its own with every ray, are intersected by callbacks.
struct ShapeCallbacks {
    const void* user = nullptr;
    uint32_t count = 0;
    bool (*flat)(const void* user, uint32_t shape, Parallelogram& out) = nullptr;  // is it?
    void (*bounds)(const void* user, uint32_t shape, Vec3f& lower, Vec3f& upper) = nullptr;
    bool (*intersect)(const void* user, uint32_t shape, Vec3f origin, Vec3f direction, float time,
                      float tnear, float tfar, float& t, Vec2f& uv) = nullptr;
};

// Those that are left to callbacks, by the number that Embree gives them.
struct CalledShapes {
    ShapeCallbacks shapes;
    std::vector<uint32_t> index;
};

// Those that are two triangles each.
struct FlatShapes {
    Mesh mesh;
    std::vector<uint32_t> index;
    uint32_t geometry = invalid_index;

    void add(uint32_t shape, const Parallelogram& p);
    // Of the parallelogram, from those of one of its triangles.
    static Vec2f parameters(uint32_t triangle, float u, float v) {
        return triangle % 2 == 0 ? Vec2f{u, v} : Vec2f{1 - u, 1 - v};
    }
};

class Acceleration {
public:
    // Builds over `meshes[0 … world_meshes)` in the world, the prototypes' ranges of the rest under
    // their instances, and the shapes. The arrays must outlive this object and not move.
    // Embree's build has one instance level: nested instances arrive flattened.
    Acceleration(std::shared_ptr<const embree::Library> library, const std::string& isa,
                 const std::vector<Mesh>& meshes, uint32_t world_meshes,
                 const std::vector<MeshRange>& prototypes, const std::vector<Instance>& instances,
                 const std::vector<Affine3f>& instance_steps, const ShapeCallbacks& shapes);

    bool intersect(const Ray& ray, Hit& hit) const {
        embree::RayHit query;
        query.ray = embree_ray(ray);
        query.hit.geom_id = query.hit.inst_id = embree::invalid_id;
        library_->rtcIntersect1(scene_.get(), &query, nullptr);
        if (query.hit.geom_id == embree::invalid_id) return false;
        hit.t = query.ray.tfar;
        hit.u = query.hit.u;
        hit.v = query.hit.v;
        hit.primitive = query.hit.prim_id;
        hit.time = ray.time;
        if (query.hit.inst_id == embree::invalid_id) {
            hit.mesh = query.hit.geom_id;
            hit.instance = invalid_index;
            if (query.hit.geom_id >= world_meshes_) set_shape(query.hit.geom_id, hit);
        } else {
            hit.instance = query.hit.inst_id - first_instance_;
            hit.mesh = instance_first_mesh_[hit.instance] + query.hit.geom_id;
        }
        return true;
    }

    bool occluded(const Ray& ray) const {
        embree::Ray query = embree_ray(ray);
        library_->rtcOccluded1(scene_.get(), &query, nullptr);
        return query.tfar < 0;
    }

    // f(t, mesh, primitive, front) for everything that a ray meets from its start to infinity, in
    // any order; front: it comes from the side that triangles face. Of meshes in the world.
    template <typename F>
    void for_each_hit(const Ray& ray, F&& f) const {
        struct Context {
            embree::RayQueryContext base;
            std::remove_reference_t<F>* f;
        } context{{embree::invalid_id, embree::invalid_id}, &f};
        embree::IntersectArguments arguments{};
        arguments.flags = embree::invoke_argument_filter;
        arguments.feature_mask = embree::all_features;
        arguments.context = &context.base;
        arguments.filter = [](const embree::FilterFunctionArguments* args) {
            if (args->valid[0] != -1) return;
            const embree::Ray& ray = *args->ray;
            const embree::Hit& hit = *args->hit;
            const bool front =
                ray.dir_x * hit.ng_x + ray.dir_y * hit.ng_y + ray.dir_z * hit.ng_z < 0;
            (*reinterpret_cast<Context*>(args->context)->f)(ray.tfar, hit.geom_id, hit.prim_id,
                                                            front);
            args->valid[0] = 0;
        };
        embree::RayHit query;
        query.ray = embree_ray(ray);
        query.ray.tfar = std::numeric_limits<float>::infinity();
        query.hit.geom_id = query.hit.inst_id = embree::invalid_id;
        library_->rtcIntersect1(scene_.get(), &query, &arguments);
    }

    // Bounds of everything that can be hit; lower > upper where there is nothing.
    void bounds(Vec3f& lower, Vec3f& upper) const;

private:
    static embree::Ray embree_ray(const Ray& ray) {
        return {ray.origin.x,
                ray.origin.y,
                ray.origin.z,
                ray.tnear,
                ray.direction.x,
                ray.direction.y,
                ray.direction.z,
                ray.time,
                ray.tfar,
                0xffffffffu,
                0,
                0};
    }
    embree::Geometry new_triangles(const Mesh& mesh) const;
    void attach_flat(FlatShapes& shapes, embree::FilterFunction filter);
    unsigned attach(embree::Scene scene, embree::Geometry geometry) const {
        const unsigned id = library_->rtcAttachGeometry(scene, geometry);
        library_->rtcReleaseGeometry(geometry);
        return id;
    }
    // Mesh, primitive and parameters of a hit of a shape.
    void set_shape(uint32_t geometry, Hit& hit) const {
        hit.mesh = invalid_index;
        const bool is_ellipse = geometry == ellipses_.geometry;
        if (!is_ellipse && geometry != parallelograms_.geometry) {
            hit.primitive = called_->index[hit.primitive];
            return;
        }
        const Vec2f p = FlatShapes::parameters(hit.primitive, hit.u, hit.v);
        hit.u = is_ellipse ? 2 * p.x - 1 : p.x;
        hit.v = is_ellipse ? 2 * p.y - 1 : p.y;
        hit.primitive = (is_ellipse ? ellipses_ : parallelograms_).index[hit.primitive / 2];
    }

    std::shared_ptr<const embree::Library> library_;
    embree::DevicePointer device_;
    std::vector<embree::ScenePointer> prototype_scenes_;
    embree::ScenePointer scene_;
    FlatShapes parallelograms_, ellipses_;
    std::unique_ptr<CalledShapes> called_;
    std::vector<uint32_t> instance_first_mesh_;
    uint32_t world_meshes_ = 0;
    uint32_t first_instance_ = 0;
};

}  // namespace usdmlt
