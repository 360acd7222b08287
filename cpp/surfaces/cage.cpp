#include "surfaces/cage.hpp"

#include <algorithm>

namespace usdmlt::surfaces {
namespace {

// Numbers the edges of a cage whose corners are known: those of the smaller vertex 0, then 1, …
void number_edges(Cage& cage) {
    const int32_t corners = cage.corner_count();
    const auto ends = [&](int32_t c) {
        return std::minmax(cage.corner_vertices[c], cage.corner_vertices[cage.following[c]]);
    };
    // Corners by the smaller vertex of their edge, and then by the larger one.
    std::vector<int32_t> start(size_t(cage.vertex_count) + 1, 0), order(size_t(corners), 0);
    for (int32_t c = 0; c < corners; ++c) ++start[size_t(ends(c).first) + 1];
    for (size_t v = 1; v < start.size(); ++v) start[v] += start[v - 1];
    std::vector<int32_t> next(start.begin(), start.end() - 1);
    for (int32_t c = 0; c < corners; ++c) order[size_t(next[ends(c).first]++)] = c;
    for (int32_t v = 0; v < cage.vertex_count; ++v)
        std::sort(order.begin() + start[v], order.begin() + start[v + 1],
                  [&](int32_t a, int32_t b) {
                      const int32_t x = ends(a).second, y = ends(b).second;
                      return x != y ? x < y : a < b;
                  });

    cage.corner_edges.resize(size_t(corners));
    std::vector<int32_t> uses, turns;
    for (const int32_t c : order) {
        const auto [low, high] = ends(c);
        if (cage.edge_vertices.empty() ||
            cage.edge_vertices.back() != std::array<int32_t, 2>{low, high}) {
            cage.edge_vertices.push_back({low, high});
            uses.push_back(0);
            turns.push_back(0);
        }
        cage.corner_edges[c] = cage.edge_count() - 1;
        ++uses.back();
        turns.back() += cage.corner_vertices[c] < cage.corner_vertices[cage.following[c]] ? 1 : -1;
    }
    cage.edge_sharpness.resize(uses.size());
    for (size_t e = 0; e < uses.size(); ++e)
        cage.edge_sharpness[e] = uses[e] == 2 && turns[e] == 0 ? 0 : infinite_sharpness;
}

// 0 smooth (one sharp edge, a dart, included), 1 crease, 2 corner.
int rule(double vertex_sharpness, int32_t sharp_edges) {
    return vertex_sharpness > 0 ? 2 : sharp_edges < 2 ? 0 : sharp_edges == 2 ? 1 : 2;
}

std::vector<int32_t> count_sharp(const Cage& cage, const std::vector<double>& sharpness) {
    std::vector<int32_t> number(size_t(cage.vertex_count), 0);
    for (int32_t e = 0; e < cage.edge_count(); ++e)
        if (sharpness[e] > 0)
            for (const int32_t v : cage.edge_vertices[e]) ++number[v];
    return number;
}

std::vector<int32_t> edges_at(const Cage& cage) {
    std::vector<int32_t> number(size_t(cage.vertex_count), 0);
    for (const auto& ends : cage.edge_vertices)
        for (const int32_t v : ends) ++number[v];
    return number;
}

// Both values of a vertex that has two if one of them is in `which`.
std::vector<bool> both(const std::vector<bool>& which, const std::vector<int32_t>& owner,
                       const std::vector<int32_t>& number) {
    std::vector<bool> either(number.size(), false), out(owner.size());
    for (size_t i = 0; i < owner.size(); ++i)
        if (which[i]) either[owner[i]] = true;
    for (size_t i = 0; i < owner.size(); ++i) out[i] = either[owner[i]] && number[owner[i]] == 2;
    return out;
}

// Which vertices of `own`, the cage of values, are corners by the rule. `owner`: whose value each
// of them is; `seam`: edges of `own` at which values end.
std::vector<bool> value_corners(const Cage& cage, const Cage& own,
                                const std::vector<int32_t>& owner, const std::vector<bool>& seam,
                                const std::string& rule) {
    const auto count = size_t(own.vertex_count);
    std::vector<bool> corners(count, false), on_seam(count, false), single(count);
    if (rule == "none") return corners;
    std::vector<int32_t> faces(count, 0);
    for (const int32_t v : own.corner_vertices) ++faces[v];
    for (size_t v = 0; v < count; ++v) single[v] = faces[v] == 1;
    for (int32_t e = 0; e < own.edge_count(); ++e)
        if (seam[e])
            for (const int32_t v : own.edge_vertices[e]) on_seam[v] = true;
    if (rule == "boundaries" || rule == "all") return on_seam;
    corners = single;
    if (rule == "cornersOnly") return corners;

    std::vector<int32_t> number(size_t(cage.vertex_count), 0);
    for (const int32_t v : owner) ++number[v];
    const std::vector<int32_t> sharp = sharp_ends(own);
    std::vector<bool> split(count);  // seams or creases divide the value's faces
    for (size_t v = 0; v < count; ++v) split[v] = sharp[v] > 2;
    const std::vector<bool> beside_split = both(split, owner, number);
    for (size_t v = 0; v < count; ++v)
        corners[v] = corners[v] || number[owner[v]] > 2 || beside_split[v];
    if (rule != "cornersPlus2") return corners;

    std::vector<int32_t> uses(size_t(cage.edge_count()), 0);
    for (const int32_t e : cage.corner_edges) ++uses[e];
    std::vector<bool> boundary(size_t(cage.vertex_count), false);
    for (int32_t e = 0; e < cage.edge_count(); ++e)
        if (uses[e] != 2)
            for (const int32_t v : cage.edge_vertices[e]) boundary[v] = true;
    const std::vector<bool> beside_single = both(single, owner, number);
    for (size_t v = 0; v < count; ++v) {
        const bool dart = on_seam[v] && number[owner[v]] == 1 && !boundary[owner[v]];
        corners[v] = corners[v] || dart || beside_single[v];
    }
    return corners;
}

}  // namespace

Cage build_cage(std::span<const int32_t> counts, std::span<const int32_t> indices,
                int32_t vertex_count) {
    Cage cage;
    cage.vertex_count = vertex_count;
    cage.face_count = static_cast<int32_t>(counts.size());
    cage.corner_vertices.assign(indices.begin(), indices.end());
    cage.vertex_sharpness.assign(size_t(vertex_count), 0);
    for (auto* array : {&cage.corner_faces, &cage.following, &cage.preceding})
        array->reserve(indices.size());
    int32_t start = 0;
    for (int32_t face = 0; face < cage.face_count; ++face) {
        const int32_t sides = counts[face];
        for (int32_t i = 0; i < sides; ++i) {
            cage.corner_faces.push_back(face);
            cage.following.push_back(start + (i + 1) % sides);
            cage.preceding.push_back(start + (i + sides - 1) % sides);
        }
        cage.root_faces.push_back(face);
        start += sides;
    }
    number_edges(cage);
    return cage;
}

int32_t find_edge(const Cage& cage, int32_t a, int32_t b) {
    const std::array<int32_t, 2> wanted = {std::min(a, b), std::max(a, b)};
    const auto found =
        std::lower_bound(cage.edge_vertices.begin(), cage.edge_vertices.end(), wanted);
    if (found == cage.edge_vertices.end() || *found != wanted) return -1;
    return static_cast<int32_t>(found - cage.edge_vertices.begin());
}

ValueCage face_varying_cage(const Cage& cage, std::span<const int32_t> counts,
                            std::span<const int32_t> values, const std::string& rule) {
    // Corners by their vertex, and then by their value.
    std::vector<int32_t> order(values.size()), vertices(values.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int32_t>(i);
    std::sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
        const int32_t v = cage.corner_vertices[a], w = cage.corner_vertices[b];
        return v != w ? v < w : values[a] != values[b] ? values[a] < values[b] : a < b;
    });
    ValueCage out;
    std::vector<int32_t> owner;
    for (const int32_t c : order) {
        if (owner.empty() || owner.back() != cage.corner_vertices[c] ||
            out.chosen.back() != values[c]) {
            owner.push_back(cage.corner_vertices[c]);
            out.chosen.push_back(values[c]);
        }
        vertices[c] = static_cast<int32_t>(owner.size()) - 1;
    }

    Cage& own = out.cage;
    own = build_cage(counts, vertices, static_cast<int32_t>(owner.size()));
    std::vector<bool> seam(size_t(own.edge_count()));
    for (int32_t e = 0; e < own.edge_count(); ++e)
        seam[e] = own.edge_sharpness[e] >= infinite_sharpness;
    for (int32_t c = 0; c < own.corner_count(); ++c) {
        double& sharpness = own.edge_sharpness[own.corner_edges[c]];
        sharpness = std::max(sharpness, cage.edge_sharpness[cage.corner_edges[c]]);
    }
    for (int32_t v = 0; v < own.vertex_count; ++v)
        own.vertex_sharpness[v] = cage.vertex_sharpness[owner[v]];
    const std::vector<bool> corners = value_corners(cage, own, owner, seam, rule);
    for (int32_t v = 0; v < own.vertex_count; ++v)
        if (corners[v]) own.vertex_sharpness[v] = infinite_sharpness;
    return out;
}

std::vector<int32_t> sharp_ends(const Cage& cage) { return count_sharp(cage, cage.edge_sharpness); }

std::vector<int32_t> valences(const Cage& cage) {
    std::vector<int32_t> number = edges_at(cage);
    for (int32_t& n : number) n = std::max(n, 1);
    return number;
}

VertexRules vertex_rules(const Cage& cage, bool blend) {
    const auto count = size_t(cage.vertex_count);
    std::vector<double> edge_after = cage.edge_sharpness, vertex_after = cage.vertex_sharpness;
    if (blend)
        for (auto* sharpness : {&edge_after, &vertex_after})
            for (double& s : *sharpness) s = weakened(s);
    const std::vector<int32_t> sharp_before = sharp_ends(cage);
    const std::vector<int32_t> sharp_after = count_sharp(cage, edge_after);

    // What runs out at each vertex: the sum of its sharpnesses, and how many they are.
    std::vector<double> total(count, 0);
    std::vector<int32_t> number(count, 0);
    for (int32_t e = 0; e < cage.edge_count(); ++e)
        if (cage.edge_sharpness[e] > 0 && edge_after[e] == 0)
            for (const int32_t v : cage.edge_vertices[e]) {
                total[v] += cage.edge_sharpness[e];
                ++number[v];
            }
    for (size_t v = 0; v < count; ++v)
        if (cage.vertex_sharpness[v] > 0 && vertex_after[v] == 0) {
            total[v] += cage.vertex_sharpness[v];
            ++number[v];
        }

    VertexRules out;
    out.vertices.resize(count);
    std::vector<int> before(count), after(count);
    const std::vector<int32_t> edges = edges_at(cage);
    for (size_t v = 0; v < count; ++v) {
        before[v] = rule(cage.vertex_sharpness[v], sharp_before[v]);
        after[v] = rule(vertex_after[v], sharp_after[v]);
        double shares[3] = {0, 0, 0};
        double share = 1;
        if (before[v] != after[v])
            share = number[v] > 0 ? std::min(total[v] / number[v], 1.0) : 0.0;
        shares[before[v]] += share;
        shares[after[v]] += 1 - share;
        out.vertices[v] = {shares[0], shares[1], shares[2]};
        if (edges[v] == 0) out.vertices[v] = {0, shares[1], 1};
    }
    out.crease_ends.resize(cage.edge_vertices.size());
    for (size_t e = 0; e < cage.edge_vertices.size(); ++e)
        for (int end = 0; end < 2; ++end) {
            const int32_t v = cage.edge_vertices[e][end];
            out.crease_ends[e][end] =
                before[v] == 1 ? cage.edge_sharpness[e] > 0 : after[v] == 1 && edge_after[e] > 0;
        }
    return out;
}

}  // namespace usdmlt::surfaces
