#include "python/bind_paths.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <map>
#include <string>

#include "base/floating_point.hpp"
#include "integrators/strategies.hpp"
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
    Edge edge;
    Spectrum value;
    if (s == 0) {
        value = emitted_contribution(scene, camera, t);
    } else {
        value = join(scene, *x, x_previous, z, z_previous);
        if (!is_black(value)) edge = edge_between(scene, *x, z, counters);
    }
    if (is_black(value) || edge.is_blocked()) return;
    Path path;
    join_subpaths(light, s, camera, t, edge, path);
    const Contribution f = contribution(scene, path);
    rows.s.push_back(s);
    rows.t.push_back(t);
    rows.weight.push_back(
        strategy_weight(scene, x, x_previous, s, z, z_previous, t, densities, edge));
    rows.weight_by_definition.push_back(power_heuristic(scene, path, s));
    value *= edge.media_transmittance();
    rows.estimate.push_back(double(value[0] + value[1] + value[2]) * edge.transmittance);
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
        const float time = sample_time(scene, sampler);
        trace_camera_subpath(scene, sampler, raster, time, depth + 1, counters, camera);
        trace_light_subpath(scene, sampler, time, depth, counters, light);
        for (int t = 2; t <= camera.count; ++t) {
            const SubpathVertex& z = camera[t - 1];
            if (z.is_light)
                compare(scene, light, 0, camera, t,
                        t > 2 ? light_densities(scene, z, camera[t - 2]) : LightDensities{}, rows);
            if (!z.can_scatter() || !z.can_connect() || t > depth) continue;
            LightDensities densities;
            if (sample_light(scene, sampler, z.position, z.time, point[0], densities.direct)) {
                densities.point = pdf_point(scene.lights, point[0].light);
                compare(scene, point, 1, camera, t, densities, rows);
            }
            for (int s = 2; s <= light.count && s + t - 1 <= depth; ++s)
                if (light[s - 1].can_connect())
                    compare(scene, light, s, camera, t, {light.pdf_point, light.pdf_direct}, rows);
        }
        for (int s = 2; s <= light.count; ++s) {
            if (!light[s - 1].can_connect()) continue;
            const Vec3f lens_point = scene.camera.sample_lens(sampler.next_2d(), time);
            Vec2f seen;
            Vec3f direction;
            if (!scene.camera.project(light[s - 1].position, lens_point, time, seen, direction))
                continue;
            camera_vertex(scene, lens_point, time, lens[0]);
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

// ---- Energy by class of path ----------------------------------------------------------------

using ClassEnergies = std::map<std::string, double>;

char joined(const SubpathVertex& v) { return v.is_medium() ? 'M' : 'D'; }
char letter(const SubpathVertex& v) { return v.component == non_delta ? joined(v) : 'S'; }

// L, the vertices between from the light on, E; vertices that are joined are non-delta.
std::string class_of(const Subpath& light, int s, const Subpath& camera, int t) {
    std::string name = "L";
    for (int i = 1; i < s - 1; ++i) name += letter(light[i]);
    if (s > 1) name += joined(light[s - 1]);
    if (s > 0 && t > 1) name += joined(camera[t - 1]);
    for (int i = t - 2; i > 0; --i) name += letter(camera[i]);
    return name + 'E';
}

struct ClassSink {
    float width, height;
    ClassEnergies& energies;

    bool place(Vec2f p, Sampler&) { return p.x >= 0 && p.y >= 0 && p.x < width && p.y < height; }
    bool wants(int, int) const { return true; }
    void glow(const Subpath&, int, const Spectrum&) {}
    void add(const StrategySample& x) {
        energies[class_of(x.light, x.s, x.camera, x.t)] += luminance(x.value);
    }
};

ClassEnergies class_energies(const Scene& scene, int samples, int depth, uint64_t seed,
                             bool bidirectional) {
    const FlushDenormals flush;
    Settings settings;
    settings.depth = depth;
    UnitStatistics statistics(depth);
    StrategyScratch scratch(depth);
    ClassEnergies energies;
    const auto width = float(scene.camera.width), height = float(scene.camera.height);
    ClassSink sink{width, height, energies};
    StrategySampler strategies(scene, settings, scratch, statistics, sink);
    for (int i = 0; i < samples; ++i) {
        Sampler eye(hash_key(seed, 0), uint32_t(i), 8), light(hash_key(seed, 1), uint32_t(i), 8);
        const Vec2f u = eye.next_2d(), raster{u.x * width, u.y * height};
        if (bidirectional) {
            strategies.sample(eye, light, raster);
            continue;
        }
        // Every light is found by chance: nothing is joined, and nothing weighted.
        const Subpath& camera = scratch.camera;
        trace_camera_subpath(scene, eye, raster, sample_time(scene, eye), depth + 1,
                             statistics.rays, scratch.camera);
        for (int t = 2; t <= camera.count; ++t)
            if (camera[t - 1].is_light)
                energies[class_of(scratch.light, 0, camera, t)] +=
                    luminance(emitted_contribution(scene, camera, t));
    }
    for (auto& [name, energy] : energies) energy /= samples;
    return energies;
}

}  // namespace

void bind_paths(py::module_& module) {
    module.def(
        "class_energies", &class_energies, py::arg("scene"), py::arg("samples"), py::arg("depth"),
        py::arg("seed") = 0, py::arg("bidirectional") = true,
        py::call_guard<py::gil_scoped_release>(),
        "Mean luminance of the image by class of path, such as LDSE, from `samples` samples of all "
        "bidirectional strategies or of paths from the eye that meet light by chance.");
    module.def(
        "strategy_probe", &strategy_probe, py::arg("scene"), py::arg("samples"), py::arg("depth"),
        py::arg("seed") = 0,
        "Joins random subpaths by every strategy. Arrays of s, t, and of weight and unweighted "
        "estimate (summed over channels), as integrators compute them and by definition "
        "from the path alone.");
}

}  // namespace usdmlt
