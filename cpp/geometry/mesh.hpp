// A triangle mesh as the core keeps it: float positions in the space of the acceleration structure
// that holds it (recentred world space, or the space of its prototype).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.hpp"

namespace usdmlt {

inline constexpr uint32_t invalid_index = 0xffffffffu;

struct Triangle {
    uint32_t v[3];
};

// Values at the corners of triangles. Without `corners`, they are indexed by the mesh's vertices.
struct CornerValues {
    int width = 0;  // floats per value, 1–4
    std::vector<float> values;
    std::vector<Triangle> corners;

    bool empty() const { return values.empty(); }
    const float* at(const Triangle& vertices, uint32_t triangle, int corner) const {
        const Triangle& t = corners.empty() ? vertices : corners[triangle];
        return values.data() + size_t(t.v[corner]) * width;
    }
};

struct Mesh {
    std::string name;  // prim path, for messages
    std::vector<Vec3f> positions;
    std::vector<Triangle> triangles;
    CornerValues normals;                      // width 3; empty: flat
    std::vector<CornerValues> primvars;        // by the scene's primvar slot; may be empty
    std::vector<uint32_t> triangle_materials;  // empty: `material` for all
    uint32_t material = 0;

    uint32_t material_of(uint32_t triangle) const {
        return triangle_materials.empty() ? material : triangle_materials[triangle];
    }
    Vec3f corner(uint32_t triangle, int i) const { return positions[triangles[triangle].v[i]]; }
};

}  // namespace usdmlt
