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

// The triangles of polygons that can be seen: without those of no area, whose height is below 1e-12
// of their longest edge, and without those of holes.
struct VisibleTriangles {
    Triangulation triangulation;
    std::vector<Triangle> vertices;  // points of each triangle
    size_t flat = 0;                 // triangles of no area
    bool as_authored = false;        // all faces are triangles and there: the arrays are empty
};
// `left_handed`: faces are wound the other way round. `holes`: of each face; empty: there are none.
VisibleTriangles visible_triangles(const Polygons& polygons, bool left_handed,
                                   std::span<const bool> holes);

}  // namespace usdmlt::surfaces
