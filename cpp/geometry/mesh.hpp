// A triangle mesh as the core keeps it: float positions in the space of the acceleration structure
// that holds it (recentred world space, or the space of its prototype). Where it moves, they are
// those at the shutter's opening.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/shared_array.hpp"
#include "geometry/motion.hpp"

namespace usdmlt {

inline constexpr uint32_t invalid_index = 0xffffffffu;

struct Triangle {
    uint32_t v[3];
};

// Values at the corners of triangles. Without `corners`, they are indexed by the mesh's vertices.
struct CornerValues {
    int width = 0;  // floats per value, 1–4
    SharedArray<float> values;
    SharedArray<Triangle> corners;

    bool empty() const { return values.empty(); }
    size_t offset(const Triangle& vertices, uint32_t triangle, int corner) const {
        const Triangle& t = corners.empty() ? vertices : corners[triangle];
        return size_t(t.v[corner]) * width;
    }
    const float* at(const Triangle& vertices, uint32_t triangle, int corner) const {
        return values.data() + offset(vertices, triangle, corner);
    }
};

struct Mesh {
    std::string name;  // prim path, for messages
    std::vector<Vec3f> positions;
    SharedArray<Triangle> triangles;
    CornerValues normals;                      // width 3; empty: flat
    std::vector<CornerValues> primvars;        // by the scene's primvar slot; may be empty
    SharedArray<uint32_t> triangle_materials;  // empty: `material` for all
    uint32_t material = 0;
    uint32_t receiver = 0;          // what lights are linked to: see LightLinks
    uint32_t link = invalid_index;  // collection that its own emission is linked to
    // Rays that come from the eye's side pass where they meet its back.
    bool one_sided = false;
    // At the further equidistant times of the shutter's interval; empty: it does not move.
    std::vector<std::vector<Vec3f>> later_positions;
    std::vector<std::vector<float>> later_normals;  // values of `normals`; empty: they stay

    bool moves() const { return !later_positions.empty(); }

    uint32_t material_of(uint32_t triangle) const {
        return triangle_materials.empty() ? material : triangle_materials[triangle];
    }
    Vec3f corner(uint32_t triangle, int i) const { return positions[triangles[triangle].v[i]]; }
    Vec3f corner(uint32_t triangle, int i, float time) const {
        if (!moves()) return corner(triangle, i);
        const TimeSegment t(time, later_positions.size() + 1);
        const uint32_t v = triangles[triangle].v[i];
        return interpolate(t.first == 0 ? positions[v] : later_positions[t.first - 1][v],
                           later_positions[t.first][v], t.fraction);
    }
};

}  // namespace usdmlt
