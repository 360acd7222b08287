#include "paths/path.hpp"

#include "paths/densities.hpp"

namespace usdmlt {

Path join_subpaths(const Subpath& light, int s, const Subpath& camera, int t, float edge) {
    Path path;
    const auto append = [&](const SubpathVertex& v, float before) {
        path.vertices.push_back(&v);
        path.component.push_back(v.component);
        path.edge.push_back(before);
    };
    for (int i = 0; i < s; ++i) append(light[i], i > 0 ? light[i].edge_transmittance : 1);
    for (int i = t - 1; i >= 0; --i) {
        // A camera vertex keeps the edge to the vertex nearer to the lens.
        const bool first = i == t - 1;
        append(camera[i], first ? (s > 0 ? edge : 1) : camera[i + 1].edge_transmittance);
    }
    if (s > 0) path.component[static_cast<size_t>(s) - 1] = non_delta;
    path.component[static_cast<size_t>(s)] = non_delta;
    return path;
}

Contribution contribution(const Scene& scene, const Path& path) {
    const int k = path.edges();
    const Spectrum emitted = radiance(scene.lights, path[0].light, direction_to(path[0], path[1]));
    const double importance = scene.camera.importance(direction_to(path[k], path[k - 1]));
    double f[3];
    for (int c = 0; c < 3; ++c) f[c] = emitted[c] * importance * path[0].opacity;
    for (int i = 1; i <= k; ++i) {
        const double g = geometry_term(path[i - 1], path[i], direction_to(path[i - 1], path[i])) *
                         path.edge[static_cast<size_t>(i)];
        Spectrum scattered(1.0f);
        if (i < k)
            scattered = scattering(path[i], direction_to(path[i], path[i - 1]),
                                   direction_to(path[i], path[i + 1]),
                                   path.component[static_cast<size_t>(i)]) *
                        path[i].opacity;
        for (int c = 0; c < 3; ++c) f[c] *= g * scattered[c];
    }
    return {{f[0], f[1], f[2]}};
}

bool has_strategy(const Path& path, int s) {
    const int k = path.edges();
    if (s < 0 || s > k) return false;
    if (s == 0) return !path[0].light.delta;
    if (k == 1) return false;  // light seen directly: found by the camera only
    // The light point and the lens can always be joined, whatever surface they lie on.
    const auto joins = [&](int i) {
        if (i == 0 || i == k) return true;
        return path.component[static_cast<size_t>(i)] == non_delta && path[i].can_connect();
    };
    return joins(s - 1) && joins(s);
}

double strategy_density(const Scene& scene, const Path& path, int s) {
    const int k = path.edges();
    const auto edge = [&](int i) { return path.edge[static_cast<size_t>(i)]; };
    const auto component = [&](int i) { return path.component[static_cast<size_t>(i)]; };
    const auto direction = [&](int from, int to) { return direction_to(path[from], path[to]); };
    double p = 1;
    for (int i = 0; i < s; ++i) {
        if (i == 0)
            p *= s == 1 ? pdf_direct(scene.lights, path[0].light, path[1].position)
                        : pdf_point(scene.lights, path[0].light);
        else if (i == 1)
            p *= density_from_light(scene, path[0], path[1], direction(0, 1), edge(1));
        else
            p *=
                density_by_scattering(path[i - 1], direction(i - 1, i - 2), path[i],
                                      direction(i - 1, i), Known::light, edge(i), component(i - 1));
    }
    for (int i = k; i >= s; --i) {
        if (i == k)
            p *= scene.camera.pdf_lens();
        else if (i == k - 1)
            p *= density_from_lens(scene, path[k], path[i], direction(k, i), edge(k));
        else
            p *= density_by_scattering(path[i + 1], direction(i + 1, i + 2), path[i],
                                       direction(i + 1, i), Known::eye, edge(i + 1),
                                       component(i + 1));
    }
    return p;
}

double power_heuristic(const Scene& scene, const Path& path, int s) {
    const double p = strategy_density(scene, path, s);
    double sum = 0;
    for (int j = 0; j <= path.edges(); ++j)
        if (has_strategy(path, j)) sum += sqr(strategy_density(scene, path, j) / p);
    return 1 / sum;
}

}  // namespace usdmlt
