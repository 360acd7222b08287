// Polygons into triangles: a fan where the polygon is convex, ear clipping where it is not.
//
// Everything is in terms of face corners, positions in USD's faceVertexIndices: a triangle of
// corners serves the values of every interpolation.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/vec.hpp"
#include "geometry/mesh.hpp"

namespace usdmlt::surfaces {

struct Polygons {
    std::span<const Vec3f> points;
    std::span<const int32_t> counts;   // corners of each face
    std::span<const int32_t> indices;  // the points of the corners, end to end

    // Whether all points are finite, counts add up and indices are in range.
    bool are_sound() const;
};

struct Triangulation {
    std::vector<Triangle> corners;  // of each triangle, in the winding of the faces
    std::vector<int32_t> faces;     // of each triangle, ascending
};

// Faces of fewer than three corners vanish. The polygons are sound.
Triangulation triangulate(const Polygons& polygons);

// Whether a triangle has an area: its height is above 1e-12 of its longest edge.
bool is_solid(Vec3d a, Vec3d b, Vec3d c);

}  // namespace usdmlt::surfaces
