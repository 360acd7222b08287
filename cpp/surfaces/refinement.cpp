#include "surfaces/refinement.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace usdmlt::surfaces {
namespace {

constexpr double smooth_triangle = 0.47;  // a triangle's share of an edge point; others have 1/4

// The half of each corner's edge that ends at the corner's vertex.
int32_t half(const Cage& cage, int32_t corner, int32_t edge) {
    return 2 * edge + (cage.edge_vertices[edge][0] != cage.corner_vertices[corner]);
}

// A cage with the halves of the coarser one's edges, in pairs, and the sharpness of these and of
// vertices; what is new is smooth.
Cage halved(const Cage& cage, int32_t vertices, int32_t faces, int32_t inner_edges) {
    const int32_t v = cage.vertex_count, e = cage.edge_count();
    Cage finer;
    finer.vertex_count = vertices;
    finer.face_count = faces;
    finer.edge_vertices.reserve(size_t(2 * e + inner_edges));
    finer.edge_sharpness.assign(size_t(2 * e + inner_edges), 0);
    for (int32_t i = 0; i < e; ++i)
        for (int end = 0; end < 2; ++end) {
            finer.edge_vertices.push_back({cage.edge_vertices[i][end], v + i});
            finer.edge_sharpness[2 * i + end] = weakened(cage.edge_sharpness[i]);
        }
    finer.vertex_sharpness.assign(size_t(vertices), 0);
    std::transform(cage.vertex_sharpness.begin(), cage.vertex_sharpness.end(),
                   finer.vertex_sharpness.begin(), weakened);
    const auto corners = size_t(4 * cage.corner_count());
    for (auto* array : {&finer.corner_vertices, &finer.corner_faces, &finer.following,
                        &finer.preceding, &finer.corner_edges})
        array->reserve(corners);
    finer.root_faces.reserve(size_t(faces));
    return finer;
}

// Appends a face of N corners.
template <int N>
void add_face(Cage& cage, const int32_t (&vertices)[N], const int32_t (&edges)[N], int32_t root) {
    const int32_t start = cage.corner_count();
    const auto face = static_cast<int32_t>(cage.root_faces.size());
    for (int i = 0; i < N; ++i) {
        cage.corner_vertices.push_back(vertices[i]);
        cage.corner_edges.push_back(edges[i]);
        cage.corner_faces.push_back(face);
        cage.following.push_back(start + (i + 1) % N);
        cage.preceding.push_back(start + (i + N - 1) % N);
    }
    cage.root_faces.push_back(root);
}

Cage split_polygons(const Cage& cage) {
    const int32_t v = cage.vertex_count, e = cage.edge_count(), corners = cage.corner_count();
    Cage finer = halved(cage, v + e + cage.face_count, corners, corners);
    for (int32_t c = 0; c < corners; ++c) {
        const int32_t edge = cage.corner_edges[c], face = cage.corner_faces[c];
        const int32_t before = cage.corner_edges[cage.preceding[c]];
        const int32_t middle = v + edge, center = v + e + face;
        finer.edge_vertices.push_back({middle, center});
        add_face<4>(
            finer, {cage.corner_vertices[c], middle, center, v + before},
            {half(cage, c, edge), 2 * e + c, 2 * e + cage.preceding[c], half(cage, c, before)},
            cage.root_faces[face]);
    }
    return finer;
}

Cage split_triangles(const Cage& cage) {
    const int32_t v = cage.vertex_count, e = cage.edge_count(), corners = cage.corner_count();
    Cage finer = halved(cage, v + e, 4 * cage.face_count, corners);
    for (int32_t c = 0; c < corners; ++c)
        finer.edge_vertices.push_back(
            {v + cage.corner_edges[c], v + cage.corner_edges[cage.preceding[c]]});
    for (int32_t first = 0; first < corners; first += 3) {
        const int32_t root = cage.root_faces[cage.corner_faces[first]];
        int32_t middles[3], inner[3];
        for (int32_t i = 0; i < 3; ++i) {
            const int32_t c = first + i, edge = cage.corner_edges[c];
            const int32_t before = cage.corner_edges[cage.preceding[c]];
            middles[i] = v + edge;
            inner[i] = 2 * e + cage.following[c];
            add_face<3>(finer, {cage.corner_vertices[c], v + edge, v + before},
                        {half(cage, c, edge), 2 * e + c, half(cage, c, before)}, root);
        }
        add_face<3>(finer, middles, inner, root);
    }
    return finer;
}

Stencils face_centers(const Cage& cage) {
    std::vector<int32_t> sides(size_t(cage.face_count), 0);
    for (const int32_t face : cage.corner_faces) ++sides[face];
    Stencils faces{cage.face_count, {}};
    faces.entries.reserve(cage.corner_faces.size());
    for (int32_t c = 0; c < cage.corner_count(); ++c)
        faces.add(cage.corner_faces[c], cage.corner_vertices[c], 1.0 / sides[cage.corner_faces[c]]);
    return faces;
}

// The weights of a vertex of n edges under the smooth rule: its own, and each neighbour's.
struct SmoothWeights {
    double center, neighbor;
};

// The points of vertices, face points aside: along creases the cubic B-spline's 1/8, 6/8, 1/8;
// corners stay.
template <class Weights>
void add_vertices(const Cage& cage, const VertexRules& rules, const std::vector<int32_t>& n,
                  Weights weights, Stencils& others) {
    for (int32_t v = 0; v < cage.vertex_count; ++v) {
        const Rules& rule = rules.vertices[v];
        others.add(v, v, rule.smooth * weights(n[v]).center + rule.crease * 0.75 + rule.corner);
    }
    for (int32_t e = 0; e < cage.edge_count(); ++e)
        for (int end = 0; end < 2; ++end) {
            const int32_t near = cage.edge_vertices[e][end], far = cage.edge_vertices[e][1 - end];
            const Rules& rule = rules.vertices[near];
            const double through = rules.crease_ends[e][end] ? rule.crease * 0.125 : 0;
            others.add(near, far, rule.smooth * weights(n[near]).neighbor + through);
        }
}

// Catmull and Clark (1978): of a vertex V of n edges, with the far ends E and the new face points
// F, V' = (n − 2)/n V + (Σ E + Σ F) / n²; an edge point is the mean of its ends and the adjacent
// face points. Beside triangles `smooth_triangles` shifts it towards them (Stam and Loop).
Refinement catmull_clark(const Cage& cage, bool smooth_triangles) {
    const int32_t v = cage.vertex_count, e = cage.edge_count(), corners = cage.corner_count();
    Refinement out{v, face_centers(cage), {v + e, {}}};
    Stencils& others = out.others;
    others.entries.reserve(size_t(2 * corners + 4 * e + v));
    std::vector<double> face_share(size_t(e), 0.25);
    if (smooth_triangles) {
        std::fill(face_share.begin(), face_share.end(), 0);
        for (int32_t c = 0; c < corners; ++c) {
            const bool triangle = cage.following[cage.following[c]] == cage.preceding[c];
            face_share[cage.corner_edges[c]] += (triangle ? smooth_triangle : 0.25) / 2;
        }
    }
    const auto smooth = [&](int32_t edge) { return 1 - std::min(cage.edge_sharpness[edge], 1.0); };
    for (int32_t i = 0; i < e; ++i)
        for (const int32_t end : cage.edge_vertices[i])
            others.add(v + i, end, 0.5 - smooth(i) * face_share[i]);
    for (int32_t c = 0; c < corners; ++c) {
        const int32_t i = cage.corner_edges[c];
        others.add(v + i, v + cage.corner_faces[c], smooth(i) * face_share[i]);
    }
    const std::vector<int32_t> n = valences(cage);
    const VertexRules rules = vertex_rules(cage, true);
    const auto weights = [](double n) { return SmoothWeights{(n - 2) / n, 1 / (n * n)}; };
    add_vertices(cage, rules, n, weights, others);
    for (int32_t c = 0; c < corners; ++c) {
        const int32_t vertex = cage.corner_vertices[c];
        others.add(vertex, v + cage.corner_faces[c],
                   rules.vertices[vertex].smooth * weights(n[vertex]).neighbor);
    }
    return out;
}

// Loop (1987): edge points are 3/8 of the ends and 1/8 of the opposite vertices; a vertex keeps
// 1 − nβ and takes β of each of its n neighbours.
Refinement loop(const Cage& cage) {
    const int32_t v = cage.vertex_count, e = cage.edge_count();
    Refinement out{v, {}, {v + e, {}}};
    const auto sharp = [&](int32_t edge) { return std::min(cage.edge_sharpness[edge], 1.0); };
    for (int32_t i = 0; i < e; ++i)
        for (const int32_t end : cage.edge_vertices[i])
            out.others.add(v + i, end, 0.5 * sharp(i) + 0.375 * (1 - sharp(i)));
    for (int32_t c = 0; c < cage.corner_count(); ++c) {
        const int32_t i = cage.corner_edges[c];
        out.others.add(v + i, cage.corner_vertices[cage.preceding[c]], 0.125 * (1 - sharp(i)));
    }
    const auto weights = [](double n) { return SmoothWeights{1 - n * loop_beta(n), loop_beta(n)}; };
    add_vertices(cage, vertex_rules(cage, true), valences(cage), weights, out.others);
    return out;
}

}  // namespace

void Stencils::apply(const double* values, int width, double* result) const {
    for (const Entry& entry : entries) {
        const double* from = values + size_t(entry.column) * width;
        double* to = result + size_t(entry.row) * width;
        for (int i = 0; i < width; ++i) to[i] += entry.weight * from[i];
    }
}

void Refinement::apply(const double* values, int width, double* result) const {
    const auto coarse = size_t(coarse_count) * width;
    std::vector<double> sources(values, values + coarse);
    sources.resize(coarse + size_t(faces.count) * width, 0);
    faces.apply(values, width, sources.data() + coarse);
    const auto end = result + size_t(others.count) * width;
    std::fill(result, end, 0);
    others.apply(sources.data(), width, result);
    std::copy(sources.begin() + static_cast<std::ptrdiff_t>(coarse), sources.end(), end);
}

double loop_beta(double n) {
    return (0.625 - std::pow(0.375 + 0.25 * std::cos(2 * std::numbers::pi / n), 2)) / n;
}

Refinement linear_refinement(const Cage& cage, Scheme scheme) {
    const int32_t v = cage.vertex_count;
    Refinement out{v, {}, {v + cage.edge_count(), {}}};
    for (int32_t i = 0; i < v; ++i) out.others.add(i, i, 1);
    for (int32_t e = 0; e < cage.edge_count(); ++e)
        for (const int32_t end : cage.edge_vertices[e]) out.others.add(v + e, end, 0.5);
    if (scheme != Scheme::loop) out.faces = face_centers(cage);
    return out;
}

Refined refine(const Cage& cage, Scheme scheme, bool smooth_triangles) {
    if (cage.corner_count() > std::numeric_limits<int32_t>::max() / 8)
        throw std::length_error("a surface of that many faces cannot be refined any further");
    if (scheme == Scheme::loop) return {split_triangles(cage), loop(cage)};
    if (scheme == Scheme::bilinear) return {split_polygons(cage), linear_refinement(cage, scheme)};
    return {split_polygons(cage), catmull_clark(cage, smooth_triangles)};
}

CageTriangles cage_triangles(const Cage& cage, bool left_handed, std::span<const bool> hidden) {
    CageTriangles out;
    const auto triangles = size_t(cage.corner_count() - 2 * cage.face_count);
    out.corners.reserve(triangles);
    out.vertices.reserve(triangles);
    out.root_faces.reserve(triangles);
    const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
        const int32_t root = cage.root_faces[cage.corner_faces[a]];
        if (!hidden.empty() && hidden[root]) return;
        if (left_handed) std::swap(b, c);
        out.corners.push_back({a, b, c});
        out.vertices.push_back({uint32_t(cage.corner_vertices[a]),
                                uint32_t(cage.corner_vertices[b]),
                                uint32_t(cage.corner_vertices[c])});
        out.root_faces.push_back(root);
    };
    for (int32_t c = 0; c < cage.corner_count(); ++c) {
        const auto start = static_cast<uint32_t>(c);
        const bool triangle = cage.following[c + 2] == c;
        add(start, start + 1, start + 2);
        if (!triangle) add(start, start + 2, start + 3);
        c += triangle ? 2 : 3;
    }
    return out;
}

}  // namespace usdmlt::surfaces
