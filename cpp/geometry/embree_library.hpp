// The part of Embree 4's C interface that usdmlt uses, loaded at run time from a shared library
// (the one inside the embreex wheel): nothing to install, nothing to link.
//
// The layouts are those of Embree 4's rtcore headers built with one instance level and the
// instance-array interface: RTCHit holds instID at word 19 and instPrimID at word 20 of RTCRayHit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace usdmlt::embree {

using Device = struct DeviceHandle*;
using Scene = struct SceneHandle*;
using Geometry = struct GeometryHandle*;

enum GeometryType : int {
    triangle_geometry = 0,
    quad_geometry = 1,
    user_geometry = 120,
    instance_geometry = 121
};
enum BufferType : int { index_buffer = 0, vertex_buffer = 1 };
enum Format : int {
    format_uint3 = 0x5003,
    format_float3 = 0x9003,
    format_float3x4_column_major = 0x9234,
};
enum SceneFlags : int { scene_flag_none = 0, scene_flag_compact = 2, scene_flag_robust = 4 };
enum BuildQuality : int { build_quality_medium = 1, build_quality_high = 2 };
enum DeviceProperty : int {
    property_version_major = 1,
    property_version_minor = 2,
    property_version_patch = 3
};

inline constexpr unsigned invalid_id = 0xffffffffu;

struct alignas(16) Ray {
    float org_x, org_y, org_z, tnear;
    float dir_x, dir_y, dir_z, time;
    float tfar;
    unsigned mask, id, flags;
};

struct alignas(16) Hit {
    float ng_x, ng_y, ng_z;
    float u, v;
    unsigned prim_id, geom_id, inst_id, inst_prim_id;
};

struct alignas(16) RayHit {
    Ray ray;
    Hit hit;
};
static_assert(offsetof(RayHit, hit) == 48);
static_assert(offsetof(RayHit, hit) + offsetof(Hit, inst_id) == 19 * 4);
static_assert(offsetof(RayHit, hit) + offsetof(Hit, inst_prim_id) == 20 * 4);

struct alignas(16) Bounds {
    float lower_x, lower_y, lower_z, align0;
    float upper_x, upper_y, upper_z, align1;
};

struct BoundsFunctionArguments {
    void* geometry_user_pointer;
    unsigned prim_id, time_step;
    Bounds* bounds;
};
// N is 1 everywhere: only rtcIntersect1 and rtcOccluded1 are called.
struct RayQueryContext {
    unsigned inst_id, inst_prim_id;
};
struct IntersectFunctionArguments {
    int* valid;
    void* geometry_user_pointer;
    unsigned prim_id;
    RayQueryContext* context;
    RayHit* ray_hit;
    unsigned n, geom_id;
};
struct OccludedFunctionArguments {
    int* valid;
    void* geometry_user_pointer;
    unsigned prim_id;
    RayQueryContext* context;
    Ray* ray;
    unsigned n, geom_id;
};
struct FilterFunctionArguments {
    int* valid;  // set to 0: the hit is passed
    void* geometry_user_pointer;
    RayQueryContext* context;
    Ray* ray;
    Hit* hit;
    unsigned n;
};
using FilterFunction = void (*)(const FilterFunctionArguments*);
enum RayQueryFlags : int { invoke_argument_filter = 2 };
inline constexpr unsigned all_features = 0xffffffffu;
struct IntersectArguments {
    int flags;
    unsigned feature_mask;
    RayQueryContext* context;
    FilterFunction filter;
    void (*intersect)(const IntersectFunctionArguments*);
    float min_width_distance_factor;  // there or not, by how Embree was built
};
using BoundsFunction = void (*)(const BoundsFunctionArguments*);
using IntersectFunction = void (*)(const IntersectFunctionArguments*);
using OccludedFunction = void (*)(const OccludedFunctionArguments*);
using ErrorFunction = void (*)(void* user, int code, const char* message);

// The functions, by their names in the C interface.
struct Library {
    Device (*rtcNewDevice)(const char* config);
    void (*rtcReleaseDevice)(Device);
    std::ptrdiff_t (*rtcGetDeviceProperty)(Device, int property);
    int (*rtcGetDeviceError)(Device);
    void (*rtcSetDeviceErrorFunction)(Device, ErrorFunction, void* user);
    Scene (*rtcNewScene)(Device);
    void (*rtcReleaseScene)(Scene);
    void (*rtcSetSceneFlags)(Scene, int flags);
    void (*rtcSetSceneBuildQuality)(Scene, int quality);
    void (*rtcCommitScene)(Scene);
    void (*rtcGetSceneBounds)(Scene, Bounds*);
    Geometry (*rtcNewGeometry)(Device, int type);
    void (*rtcReleaseGeometry)(Geometry);
    void (*rtcCommitGeometry)(Geometry);
    unsigned (*rtcAttachGeometry)(Scene, Geometry);
    void (*rtcSetSharedGeometryBuffer)(Geometry, int type, unsigned slot, int format,
                                       const void* data, size_t offset, size_t stride,
                                       size_t count);
    void (*rtcSetGeometryTimeStepCount)(Geometry, unsigned);
    void (*rtcSetGeometryUserData)(Geometry, void*);
    void (*rtcSetGeometryUserPrimitiveCount)(Geometry, unsigned);
    void (*rtcSetGeometryBoundsFunction)(Geometry, BoundsFunction, void* user);
    void (*rtcSetGeometryIntersectFunction)(Geometry, IntersectFunction);
    void (*rtcSetGeometryOccludedFunction)(Geometry, OccludedFunction);
    void (*rtcSetGeometryIntersectFilterFunction)(Geometry, FilterFunction);
    void (*rtcSetGeometryOccludedFilterFunction)(Geometry, FilterFunction);
    void (*rtcSetGeometryInstancedScene)(Geometry, Scene);
    void (*rtcSetGeometryTransform)(Geometry, unsigned time_step, int format, const void*);
    void (*rtcIntersect1)(Scene, RayHit*, void* arguments);
    void (*rtcOccluded1)(Scene, Ray*, void* arguments);

    std::string path;
    std::string version;  // "4.4.0"
};

// Loads the library once per path and checks that its major version is 4.
// Throws std::runtime_error with one line that names the file.
std::shared_ptr<const Library> load(const std::string& path);

// Releases handles by the library that made them.
struct DeviceDeleter {
    const Library* library;
    void operator()(Device d) const { library->rtcReleaseDevice(d); }
};
struct SceneDeleter {
    const Library* library;
    void operator()(Scene s) const { library->rtcReleaseScene(s); }
};
using DevicePointer = std::unique_ptr<DeviceHandle, DeviceDeleter>;
using ScenePointer = std::unique_ptr<SceneHandle, SceneDeleter>;

// `isa` is Embree's instruction set, for instance "avx2"; results differ between sets.
DevicePointer new_device(const Library& library, const std::string& isa);

}  // namespace usdmlt::embree
