#include "python/bind_embree.hpp"

#include <limits>
#include <string>
#include <vector>

#include "geometry/embree_library.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

struct Point {
    float x, y, z;
};
struct Corners {
    unsigned v[3];
};

// One triangle across the z axis at z = 0; one vertex more than it has, because Embree reads 16
// bytes at the last.
constexpr Point points[] = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, 0}};
constexpr Corners corners[] = {{{0, 1, 2}}};
constexpr float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};

// Scenes within scenes: 0 holds a triangle, each further one an instance of the one before.
class NestedScenes {
public:
    explicit NestedScenes(const embree::Library& library)
        : library_(library), device_(embree::new_device(library, "")) {
        const embree::Geometry triangle =
            library.rtcNewGeometry(device_.get(), embree::triangle_geometry);
        library.rtcSetSharedGeometryBuffer(triangle, embree::vertex_buffer, 0,
                                           embree::format_float3, points, 0, sizeof(Point), 3);
        library.rtcSetSharedGeometryBuffer(triangle, embree::index_buffer, 0, embree::format_uint3,
                                           corners, 0, sizeof(Corners), 1);
        scenes_.push_back(scene_of(triangle));
    }

    void nest() {
        const embree::Geometry instance =
            library_.rtcNewGeometry(device_.get(), embree::instance_geometry);
        library_.rtcSetGeometryInstancedScene(instance, scenes_.back().get());
        library_.rtcSetGeometryTransform(instance, 0, embree::format_float3x4_column_major,
                                         identity);
        scenes_.push_back(scene_of(instance));
    }

    // Whether a ray down the axis meets the triangle.
    bool hit() const {
        embree::RayHit query{};
        query.ray = {0, 0, 1, 0, 0, 0, -1, 0, std::numeric_limits<float>::infinity(), ~0u, 0, 0};
        query.hit.geom_id = query.hit.inst_id = embree::invalid_id;
        library_.rtcIntersect1(scenes_.back().get(), &query, nullptr);
        return query.hit.geom_id != embree::invalid_id;
    }

private:
    embree::ScenePointer scene_of(embree::Geometry geometry) const {
        embree::ScenePointer scene(library_.rtcNewScene(device_.get()), {&library_});
        library_.rtcCommitGeometry(geometry);
        library_.rtcAttachGeometry(scene.get(), geometry);
        library_.rtcReleaseGeometry(geometry);
        library_.rtcCommitScene(scene.get());
        return scene;
    }

    const embree::Library& library_;
    embree::DevicePointer device_;
    std::vector<embree::ScenePointer> scenes_;
};

// Instance levels that rays follow, counted up to `limit`. Where the build has fewer than the
// scenes nest, a ray misses without an error.
int instance_levels(const std::string& path, int limit) {
    const auto library = embree::load(path);
    NestedScenes scenes(*library);
    int levels = 0;
    while (levels < limit) {
        scenes.nest();
        if (!scenes.hit()) break;
        ++levels;
    }
    return levels;
}

}  // namespace

void bind_embree(py::module_& module) {
    module.def(
        "embree_version", [](const std::string& path) { return embree::load(path)->version; },
        py::arg("library"), "Version of the Embree library at a path, for instance '4.4.0'.");
    module.def("embree_instance_levels", &instance_levels, py::arg("library"), py::arg("limit") = 4,
               "How deep instances of instances are followed by rays, at most `limit`.");
}

}  // namespace usdmlt
