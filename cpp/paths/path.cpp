#include "paths/path.hpp"

#include <algorithm>

#include "paths/densities.hpp"
#include "paths/emission.hpp"

namespace usdmlt {

void join_subpaths(const Subpath& light, int s, const Subpath& camera, int t, const Edge& edge,
                   Path& path) {
    path.vertices.clear();
    path.time = camera[0].time;
    const auto append = [&](const SubpathVertex& v, const Edge& before) {
        PathVertex vertex;
        vertex.vertex = &v;
        vertex.component = v.component;
        vertex.edge = before;
        path.vertices.push_back(vertex);
    };
    for (int i = 0; i < s; ++i) append(light[i], i > 0 ? light[i].edge : Edge{});
    for (int i = t - 1; i >= 0; --i) {
        // A camera vertex keeps the edge to the vertex nearer to the lens.
        const bool first = i == t - 1;
        append(camera[i], first ? (s > 0 ? edge : Edge{}) : camera[i + 1].edge);
    }
    if (s > 0) path.at(s - 1).component = non_delta;
    path.at(s).component = non_delta;
    update_edges(path, 1, path.edges());
}

void update_edges(Path& path, int first, int last) {
    for (int i = first; i <= last; ++i) {
        PathVertex& v = path.at(i);
        v.direction = direction_to(path[i - 1], path[i]);
        v.geometry = geometry_term(path[i - 1], path[i], v.direction) * v.edge.transmittance;
    }
}

bool update_scattering(const Scene& scene, Path& path, int first, int last) {
    const int k = path.edges();
    for (int i = first; i <= last; ++i) {
        PathVertex& v = path.at(i);
        if (i == 0)
            v.scattering = emission(scene, path[0], path[1], path.to_eye(0)) * path[0].opacity;
        else if (i == k)
            v.scattering =
                Spectrum(static_cast<float>(scene.camera.importance(path.to_light(k), path.time)));
        else
            v.scattering = scattering(path[i], path.to_light(i), path.to_eye(i), v.component) *
                           path[i].opacity;
        if (i > 0 && !scene.media.empty()) [[unlikely]]
            v.scattering *= v.edge.media_transmittance();
        if (is_black(v.scattering)) return false;
    }
    return true;
}

Contribution product_of_factors(const Path& path) {
    Contribution f;
    const Spectrum& emitted = path.at(0).scattering;
    for (int c = 0; c < 3; ++c) f.c[c] = emitted[c];
    for (int i = 1; i <= path.edges(); ++i) {
        const PathVertex& v = path.at(i);
        for (int c = 0; c < 3; ++c) f.c[c] *= v.geometry * v.scattering[c];
        const double size = std::max({std::fabs(f.c[0]), std::fabs(f.c[1]), std::fabs(f.c[2])});
        constexpr double large = 0x1p256, small = 0x1p-256;
        if ((size > large && size < 0x1p1023) || (size < small && size > 0)) {
            int e;
            std::frexp(size, &e);
            for (int c = 0; c < 3; ++c) f.c[c] = std::ldexp(f.c[c], -e);
            f.exponent += e;
        }
    }
    return f;
}

Contribution contribution(const Scene& scene, Path& path) {
    update_edges(path, 1, path.edges());
    if (!update_scattering(scene, path, 0, path.edges())) return {};
    return product_of_factors(path);
}

double density_from_light_side(const Scene& scene, const Path& path, int i) {
    if (i == 0) return pdf_point(scene.lights, path[0].light);
    const Edge& edge = path.at(i).edge;
    if (i == 1) return density_from_light(scene, path[0], path[1], path.to_eye(0), edge);
    return density_by_scattering(path[i - 1], path.to_light(i - 1), path[i], path.to_eye(i - 1),
                                 Known::light, edge, path.at(i - 1).component);
}

double density_from_eye_side(const Scene& scene, const Path& path, int i) {
    const int k = path.edges();
    if (i == k) return scene.camera.pdf_lens();
    const Edge& edge = path.at(i + 1).edge;
    if (i == k - 1) return density_from_lens(scene, path[k], path[i], path.to_light(k), edge);
    return density_by_scattering(path[i + 1], path.to_eye(i + 1), path[i], path.to_light(i + 1),
                                 Known::eye, edge, path.at(i + 1).component);
}

bool has_strategy(const Path& path, int s) {
    const int k = path.edges();
    if (s < 0 || s > k) return false;
    if (s == 0) return !path[0].light.delta;
    if (k == 1) return false;  // light seen directly: found by the camera only
    // The light point and the lens can always be joined, whatever surface they lie on.
    const auto joins = [&](int i) {
        if (i == 0 || i == k) return true;
        return !path.is_delta(i) && path[i].can_connect();
    };
    return joins(s - 1) && joins(s);
}

ScaledDouble strategy_density(const Scene& scene, const Path& path, int s) {
    ScaledDouble p = 1;
    for (int i = 0; i < s; ++i)
        p *= i == 0 && s == 1 ? pdf_direct(scene.lights, path[0].light, path[1].position)
                              : density_from_light_side(scene, path, i);
    for (int i = path.edges(); i >= s; --i) p *= density_from_eye_side(scene, path, i);
    return p;
}

void update_densities(const Scene& scene, Path& path, int first, int last) {
    const int k = path.edges();
    // A direction of scattering is made of two edges.
    for (int i = std::max(first, 0); i <= std::min(last + 2, k - 1); ++i)
        path.at(i).from_light = density_from_light_side(scene, path, i);
    for (int i = std::max(first - 2, 0); i <= std::min(last, k); ++i)
        path.at(i).from_eye = density_from_eye_side(scene, path, i);
    if (first <= 1 && k > 1)
        path.direct = pdf_direct(scene.lights, path[0].light, path[1].position);
}

namespace {

// Σ_s p_s², Real being double or ScaledDouble. `products`: E_s = Π_{i ≥ s} p_E(x_i).
template <typename Real>
Real sum_of_squares(const Path& path, std::vector<Real>& products) {
    const int k = path.edges();
    Real* eye = products.data();
    eye[k + 1] = 1;
    for (int i = k; i >= 0; --i) eye[i] = eye[i + 1] * path.at(i).from_eye;
    Real sum = 0, light = 1;
    for (int s = 0; s <= k; ++s) {
        if (s > 0) light *= path.at(s - 1).from_light;
        if (!has_strategy(path, s)) continue;
        const Real p = eye[s] * (s == 1 ? Real(path.direct) : light);
        sum += p * p;
    }
    return sum;
}

}  // namespace

ScaledDouble squared_strategy_densities(const Path& path, DensityScratch& scratch) {
    // What underflows is nothing beside a sum of this size.
    constexpr double least = 0x1p-600, most = 0x1p900;
    const double sum = sum_of_squares(path, scratch.plain);
    if (sum > least && sum < most) return sum;
    return sum_of_squares(path, scratch.scaled);
}

double power_heuristic(const Scene& scene, const Path& path, int s) {
    const ScaledDouble p = strategy_density(scene, path, s);
    double sum = 0;
    for (int j = 0; j <= path.edges(); ++j)
        if (has_strategy(path, j)) sum += sqr(ratio(strategy_density(scene, path, j), p));
    return 1 / sum;
}

}  // namespace usdmlt
