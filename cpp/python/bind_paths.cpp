#include "python/bind_paths.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "base/floating_point.hpp"
#include "paths/connect.hpp"
#include "paths/path.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

// What is known of one joined path twice: from the recurrences of the subpaths, and from the path
// alone by definition.
struct Rows {
    std::vector<int> s, t;
    std::vector<double> weight, weight_by_definition, estimate, estimate_by_definition;
};

void compare(const Scene& scene, const Subpath& light, int s, const Subpath& camera, int t,
             const LightDensities& densities, Rows& rows) {
    const SubpathVertex& z = camera[t - 1];
    const SubpathVertex* z_previous = t >= 2 ? &camera[t - 2] : nullptr;
    const SubpathVertex* x = s >= 1 ? &light[s - 1] : nullptr;
    const SubpathVertex* x_previous = s >= 2 ? &light[s - 2] : nullptr;
    RayCounters counters;
    float edge = 1;
    Spectrum value;
    if (s == 0) {
        value = emitted_contribution(scene, camera, t);
    } else {
        value = join(scene, *x, x_previous, z, z_previous);
        if (!is_black(value)) edge = transmittance(scene, *x, z, counters);
    }
    if (is_black(value) || edge == 0) return;
    Path path;
    join_subpaths(light, s, camera, t, edge, path);
    const Contribution f = contribution(scene, path);
    rows.s.push_back(s);
    rows.t.push_back(t);
    rows.weight.push_back(
        strategy_weight(scene, x, x_previous, s, z, z_previous, t, densities, edge));
    rows.weight_by_definition.push_back(power_heuristic(scene, path, s));
    rows.estimate.push_back(double(value[0] + value[1] + value[2]) * edge);
    ScaledDouble sum = f.c[0] + f.c[1] + f.c[2];
    sum.exponent += f.exponent;
    rows.estimate_by_definition.push_back(ratio(sum, strategy_density(scene, path, s)));
}

py::dict strategy_probe(const Scene& scene, int samples, int depth, uint64_t seed) {
    const FlushDenormals flush;
    Subpath camera(depth + 2), light(depth + 1), point(1), lens(1);
    camera.roulette = light.roulette = false;
    RayCounters counters;
    Rows rows;
    for (int i = 0; i < samples; ++i) {
        Sampler sampler(hash_key(seed, uint64_t(i)), 0, 0);
        const Vec2f u = sampler.next_2d();
        const Vec2f raster{u.x * float(scene.camera.width), u.y * float(scene.camera.height)};
        trace_camera_subpath(scene, sampler, raster, depth + 1, counters, camera);
        trace_light_subpath(scene, sampler, depth, counters, light);
        for (int t = 2; t <= camera.count; ++t) {
            const SubpathVertex& z = camera[t - 1];
            if (z.is_light)
                compare(scene, light, 0, camera, t,
                        t > 2 ? light_densities(scene, z, camera[t - 2]) : LightDensities{}, rows);
            if (!z.is_surface() || !z.can_connect() || t > depth) continue;
            LightDensities densities;
            if (sample_light(scene, sampler, z, point[0], densities.direct)) {
                densities.point = pdf_point(scene.lights, point[0].light);
                compare(scene, point, 1, camera, t, densities, rows);
            }
            for (int s = 2; s <= light.count && s + t - 1 <= depth; ++s)
                if (light[s - 1].can_connect())
                    compare(scene, light, s, camera, t, {light.pdf_point, light.pdf_direct}, rows);
        }
        for (int s = 2; s <= light.count; ++s) {
            if (!light[s - 1].can_connect()) continue;
            const Vec3f lens_point = scene.camera.sample_lens(sampler.next_2d());
            Vec2f seen;
            Vec3f direction;
            if (!scene.camera.project(light[s - 1].position, lens_point, seen, direction)) continue;
            camera_vertex(scene, lens_point, lens[0]);
            lens[0].throughput = Spectrum(1.0f);
            compare(scene, light, s, lens, 1, {light.pdf_point, light.pdf_direct}, rows);
        }
    }
    py::dict out;
    out["s"] = py::array(py::cast(rows.s));
    out["t"] = py::array(py::cast(rows.t));
    out["weight"] = py::array(py::cast(rows.weight));
    out["weight_by_definition"] = py::array(py::cast(rows.weight_by_definition));
    out["estimate"] = py::array(py::cast(rows.estimate));
    out["estimate_by_definition"] = py::array(py::cast(rows.estimate_by_definition));
    return out;
}

}  // namespace

void bind_paths(py::module_& module) {
    module.def(
        "strategy_probe", &strategy_probe, py::arg("scene"), py::arg("samples"), py::arg("depth"),
        py::arg("seed") = 0,
        "Joins random subpaths by every strategy. Arrays of s, t, and of weight and unweighted "
        "estimate (summed over channels), as integrators compute them and by definition "
        "from the path alone.");
}

}  // namespace usdmlt
