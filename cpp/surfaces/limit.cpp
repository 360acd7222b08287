#include "surfaces/limit.hpp"

#include <cmath>
#include <map>
#include <numbers>

namespace usdmlt::surfaces {
namespace {

int32_t across_face(const Cage& cage, int32_t corner) {
    return cage.corner_vertices[cage.following[cage.following[corner]]];
}

// The corner whose edge is the same the other way round, for each corner; −1 if there is none.
std::vector<int32_t> twins(const Cage& cage) {
    std::vector<std::array<int32_t, 2>> users(size_t(cage.edge_count()), {-1, -1});
    std::vector<int32_t> uses(size_t(cage.edge_count()), 0), out(size_t(cage.corner_count()), -1);
    for (int32_t c = 0; c < cage.corner_count(); ++c) {
        const int32_t e = cage.corner_edges[c];
        if (uses[e] < 2) users[e][uses[e]] = c;
        ++uses[e];
    }
    for (int32_t e = 0; e < cage.edge_count(); ++e) {
        const auto [a, b] = users[e];
        if (uses[e] != 2 || cage.corner_vertices[a] == cage.corner_vertices[b]) continue;
        out[a] = b;
        out[b] = a;
    }
    return out;
}

double edge_weight(Scheme scheme, double t) {
    if (scheme == Scheme::loop) return 1;
    return 1 + std::cos(t) + std::cos(t / 2) * std::sqrt(2 * (9 + std::cos(t)));
}

// The weights across a crease of its neighbours E_0 and E_k, and of the vertex.
//
// With eigenvalue l, the column of E_0 says (l − ½) a = b/8 + sin t (A + 4)/16, and all weights add
// up to 0; Loop: (l − ½) a = b/8 + sin t / 8. A single face has a = 1, b = −2.
struct CreaseEnds {
    double end = 1, center = -2;

    CreaseEnds(Scheme scheme, int32_t faces) {
        if (faces == 1) return;
        const double t = std::numbers::pi / faces, cot = 1 / std::tan(t / 2);
        const double weight = edge_weight(scheme, t);
        const bool loop = scheme == Scheme::loop;
        const double eigenvalue = loop ? 0.375 + std::cos(t) / 4 : (4 + weight) / 16;
        const double inner = loop ? std::sin(t) / 8 : std::sin(t) * (weight + 4) / 16;
        const double total = loop ? cot : (weight + 2) * cot;
        end = (inner - total / 8) / (eigenvalue - 0.25);
        center = -2 * end - total;
    }
};

// What the tangents of sectors of so many faces have in common.
struct SectorMask {
    double edge;
    std::vector<double> cosines, sines;  // of jt
    CreaseEnds ends;

    SectorMask(Scheme scheme, int32_t faces, bool closed) : ends(scheme, faces) {
        const double t = (closed ? 2 : 1) * std::numbers::pi / faces;
        edge = edge_weight(scheme, t);
        for (int32_t j = 0; j <= faces; ++j) {
            cosines.push_back(std::cos(t * j));
            sines.push_back(std::sin(t * j));
        }
    }
};

// `fallback` where the vector is nothing but rounding errors of what it was made from.
Vec3d unit(Vec3d v, double size, Vec3d fallback = {0, 0, 1}) {
    const double l = length(v);
    return l > 1e-12 * size ? Vec3d{v.x / l, v.y / l, v.z / l} : fallback;
}

Vec3d face_normal(const Cage& cage, const Vec3d* limit, int32_t corner) {
    const Vec3d at = limit[cage.corner_vertices[corner]];
    return cross(limit[cage.corner_vertices[cage.following[corner]]] - at,
                 limit[cage.corner_vertices[cage.preceding[corner]]] - at);
}

}  // namespace

Stencils limit_positions(const Cage& cage, Scheme scheme) {
    Stencils out{cage.vertex_count, {}};
    const VertexRules rules = vertex_rules(cage, false);
    const std::vector<int32_t> n = valences(cage);
    const auto neighbor = [&](double n) {
        return scheme == Scheme::loop ? 1 / (n + 3 / (8 * loop_beta(n))) : 4 / (n * (n + 5));
    };
    if (scheme != Scheme::loop)
        for (int32_t c = 0; c < cage.corner_count(); ++c) {
            const int32_t v = cage.corner_vertices[c];
            out.add(v, across_face(cage, c),
                    rules.vertices[v].smooth / (double(n[v]) * (n[v] + 5)));
        }
    for (int32_t v = 0; v < cage.vertex_count; ++v) {
        const Rules& rule = rules.vertices[v];
        const double center =
            scheme == Scheme::loop ? 1 - n[v] * neighbor(n[v]) : double(n[v]) / (n[v] + 5);
        out.add(v, v, rule.smooth * center + rule.crease * 2 / 3 + rule.corner);
    }
    for (int32_t e = 0; e < cage.edge_count(); ++e)
        for (int end = 0; end < 2; ++end) {
            const int32_t near = cage.edge_vertices[e][end], far = cage.edge_vertices[e][1 - end];
            const Rules& rule = rules.vertices[near];
            out.add(near, far,
                    rule.smooth * neighbor(n[near]) +
                        (rules.crease_ends[e][end] ? rule.crease / 6 : 0));
        }
    return out;
}

Sectors find_sectors(const Cage& cage) {
    const std::vector<int32_t> sharp = sharp_ends(cage), twin = twins(cage);
    const auto corners = size_t(cage.corner_count());
    // The corner at the same vertex beyond the preceding edge.
    std::vector<int32_t> left(corners);
    std::vector<bool> has_right(corners, false);
    for (size_t c = 0; c < corners; ++c) {
        const int32_t before = cage.preceding[c];
        const bool divided = sharp[cage.corner_vertices[c]] >= 2 &&
                             cage.edge_sharpness[cage.corner_edges[before]] > 0;
        left[c] = divided ? -1 : twin[before];
        if (left[c] >= 0) has_right[left[c]] = true;
    }
    Sectors out;
    out.sector.assign(corners, -1);
    out.position.assign(corners, 0);
    const auto walk = [&](int32_t start, bool closed) {
        int32_t step = 0;
        for (int32_t c = start; c >= 0 && out.sector[c] < 0; c = left[c]) {
            out.sector[c] = static_cast<int32_t>(out.size.size());
            out.position[c] = step++;
        }
        out.size.push_back(step);
        out.closed.push_back(closed);
    };
    for (size_t c = 0; c < corners; ++c)
        if (!has_right[c]) walk(static_cast<int32_t>(c), false);
    for (size_t c = 0; c < corners; ++c)  // what is left goes all the way round its vertex
        if (out.sector[c] < 0) walk(static_cast<int32_t>(c), true);
    return out;
}

Tangents tangents(const Cage& cage, Scheme scheme, const Sectors& sectors) {
    const auto count = static_cast<int32_t>(sectors.size.size());
    Tangents out{{count, {}}, {count, {}}};
    const std::vector<int32_t> sharp = sharp_ends(cage);
    std::map<std::pair<int32_t, bool>, SectorMask> masks;
    const SectorMask* mask = nullptr;  // of the sectors before, most of which are alike
    std::pair<int32_t, bool> kind{0, false};
    for (int32_t c = 0; c < cage.corner_count(); ++c) {
        const int32_t v = cage.corner_vertices[c], s = sectors.sector[c], j = sectors.position[c];
        if (cage.vertex_sharpness[v] > 0 || sharp[v] > 2) continue;
        const std::pair<int32_t, bool> own{sectors.size[s], sectors.closed[s] != 0};
        if (mask == nullptr || own != kind) {
            kind = own;
            mask = &masks.try_emplace(own, scheme, own.first, own.second).first->second;
        }
        const int32_t ahead = cage.corner_vertices[cage.following[c]];
        const auto add_wave = [&](Stencils& stencils, const std::vector<double>& wave) {
            stencils.add(s, ahead, mask->edge * wave[j]);
            if (scheme != Scheme::loop)
                stencils.add(s, across_face(cage, c), wave[j] + wave[j + 1]);
        };
        if (own.second) {
            add_wave(out.along, mask->cosines);
            add_wave(out.across, mask->sines);
            continue;
        }
        if (own.first > 1) add_wave(out.across, mask->sines);
        if (j == 0) {
            out.along.add(s, ahead, 1);
            out.across.add(s, ahead, mask->ends.end);
            out.across.add(s, v, mask->ends.center);
        }
        if (j == own.first - 1) {
            const int32_t behind = cage.corner_vertices[cage.preceding[c]];
            out.along.add(s, behind, -1);
            out.across.add(s, behind, mask->ends.end);
        }
    }
    return out;
}

Normals limit_normals(const Cage& cage, Scheme scheme, const Vec3d* vertices, const Vec3d* limit) {
    Normals out;
    if (scheme == Scheme::bilinear) {
        for (int32_t c = 0; c < cage.corner_count(); ++c) {
            out.values.push_back(unit(face_normal(cage, limit, c), 0));
            out.of_corner.push_back(c);
        }
        return out;
    }
    Sectors sectors = find_sectors(cage);
    const Tangents mask = tangents(cage, scheme, sectors);
    const size_t count = sectors.size.size();
    std::vector<Vec3d> along(count), across(count), flat(count);
    std::vector<double> area(count, 0);
    static_assert(sizeof(Vec3d) == 3 * sizeof(double));
    mask.along.apply(&vertices->x, 3, &along.data()->x);
    mask.across.apply(&vertices->x, 3, &across.data()->x);
    for (int32_t c = 0; c < cage.corner_count(); ++c) {
        const int32_t s = sectors.sector[c];
        const Vec3d normal = face_normal(cage, limit, c);
        flat[s] = flat[s] + normal;
        area[s] += length(normal);
    }
    out.values.reserve(count);
    for (size_t s = 0; s < count; ++s)
        out.values.push_back(unit(cross(along[s], across[s]),
                                  dot(along[s], along[s]) + dot(across[s], across[s]),
                                  unit(flat[s], area[s])));
    out.of_corner = std::move(sectors.sector);
    return out;
}

}  // namespace usdmlt::surfaces
