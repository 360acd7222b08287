// Cages of subdivision surfaces: polygons, their edges, and how sharp edges and vertices are.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace usdmlt::surfaces {

enum class Scheme : uint8_t { catmull_clark, loop, bilinear };

// Sharpness from which on an edge stays sharp, as UsdGeomMesh and OpenSubdiv say.
inline constexpr double infinite_sharpness = 10;

// Corner c of face corner_faces[c] is at vertex corner_vertices[c]; following[c] and preceding[c]
// are its neighbours in the face; corner_edges[c] is the edge to the following one.
struct Cage {
    int32_t vertex_count = 0, face_count = 0;
    std::vector<int32_t> corner_vertices, corner_faces, following, preceding, corner_edges;
    std::vector<std::array<int32_t, 2>> edge_vertices;
    std::vector<double> edge_sharpness;    // infinite on boundaries
    std::vector<double> vertex_sharpness;  // 0 but for corners
    std::vector<int32_t> root_faces;       // of each face: of the coarsest cage, the one it is from

    int32_t corner_count() const { return static_cast<int32_t>(corner_vertices.size()); }
    int32_t edge_count() const { return static_cast<int32_t>(edge_vertices.size()); }
};

// Of polygons as UsdGeomMesh lists them, of at least three sides each, with edges by their smaller
// and then their larger vertex. Sharp where an edge has other than two faces, or where its two are
// turned against each other.
Cage build_cage(std::span<const int32_t> counts, std::span<const int32_t> indices,
                int32_t vertex_count);

// The edge between two vertices; -1 if there is none.
int32_t find_edge(const Cage& cage, int32_t a, int32_t b);

// Face-varying values: the cage whose vertices are the distinct values at each vertex of `cage`,
// and which value each of them has. `values`: of each corner. Where a value continues across an
// edge the surface's sharpness applies; its boundaries are creases, and `rule`,
// faceVaryingLinearInterpolation of UsdGeomMesh, says which of their vertices are corners
// (OpenSubdiv's Vtr::FVarLevel):
//
//   cornersOnly   those with one face;
//   cornersPlus1  and all where more than two values meet;
//   cornersPlus2  and the other side of a corner, and where seams end (darts);
//   boundaries    all of them; none: none.
struct ValueCage {
    Cage cage;
    std::vector<int32_t> chosen;
};
ValueCage face_varying_cage(const Cage& cage, std::span<const int32_t> counts,
                            std::span<const int32_t> values, const std::string& rule);

// ------------------------------------------------------------------------------------------------
// Which rule a vertex has

// Shares of the smooth, crease and corner rules, adding up to 1.
struct Rules {
    double smooth = 0, crease = 0, corner = 0;
};
struct VertexRules {
    std::vector<Rules> vertices;
    std::vector<std::array<bool, 2>> crease_ends;  // edge ends that a crease runs through
};

// Sharpness one level on.
inline double weakened(double sharpness) {
    return sharpness >= infinite_sharpness ? sharpness : (sharpness > 1 ? sharpness - 1 : 0);
}

// How many sharp edges each vertex has.
std::vector<int32_t> sharp_ends(const Cage& cage);

// How many edges each vertex has, at least 1.
std::vector<int32_t> valences(const Cage& cage);

// Where sharpness runs out with a refinement, the rules before and after are blended by the mean of
// what runs out (OpenSubdiv's Sdc::Crease); without `blend`, those before count.
VertexRules vertex_rules(const Cage& cage, bool blend);

}  // namespace usdmlt::surfaces
