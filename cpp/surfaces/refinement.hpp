// Uniform refinement of subdivision surfaces: Catmull–Clark, Loop and bilinear.
//
// What makes the vertices of the finer cage depends on the topology only: it serves points,
// primvars and face-varying values alike. Sharpness follows Hoppe et al. (1994) and DeRose, Kass
// and Truong (1998): it falls by one with each refinement, and between 0 and 1 the sharp and the
// smooth rule are blended.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/mesh.hpp"
#include "surfaces/cage.hpp"

namespace usdmlt::surfaces {

// Weighted sums of rows of an array: a sparse matrix by its entries, in any order.
struct Stencils {
    struct Entry {
        int32_t row, column;
        double weight;
    };
    int32_t count = 0;  // rows
    std::vector<Entry> entries;

    void add(int32_t row, int32_t column, double weight) {
        if (weight != 0) entries.push_back({row, column, weight});
    }
    // Adds to `result`, (count, width), from (columns, width).
    void apply(const double* values, int width, double* result) const;
};

// The vertices of a finer cage from those of a coarser one: those of vertices, then of edges, which
// may be made from the last, those in the middle of faces.
struct Refinement {
    int32_t coarse_count = 0;
    Stencils faces, others;

    int32_t count() const { return others.count + faces.count; }
    // `result`, (count, width), is overwritten, from (coarse_count, width).
    void apply(const double* values, int width, double* result) const;
};

struct Refined {
    Cage cage;
    Refinement refinement;
};

// One level: every face into one quadrilateral per corner, or, by Loop's scheme, every triangle
// into four. `smooth_triangles`: UsdGeomMesh's triangleSubdivisionRule. Throws std::length_error
// for more corners than can be counted.
Refined refine(const Cage& cage, Scheme scheme, bool smooth_triangles);

// Linear interpolation to the vertices that a refinement makes: vertices stay, edges are halved,
// faces, unless by Loop's scheme, get their mean.
Refinement linear_refinement(const Cage& cage, Scheme scheme);

// Loop's weight of each of n neighbours: (5/8 − (3/8 + cos(2π/n) / 4)²) / n.
double loop_beta(double n);

// The triangles of a cage that refinement made, or of one that is like it: two for each
// quadrilateral.
struct CageTriangles {
    std::vector<Triangle> corners, vertices;
    std::vector<int32_t> root_faces;
};
// `hidden`: of the coarsest cage's faces, those to leave out; empty: none.
CageTriangles cage_triangles(const Cage& cage, bool left_handed, std::span<const bool> hidden);

}  // namespace usdmlt::surfaces
