// Probes of media for tests: phase functions, optical depths and collisions over arrays.
#include <pybind11/numpy.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "base/floating_point.hpp"
#include "media/optical_depth.hpp"
#include "python/bind_media.hpp"
#include "scene/scene.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

PhaseFunction phase_function(const std::string& kind, float g) {
    if (kind != "rayleigh" && kind != "henyey_greenstein")
        throw std::invalid_argument("no phase function " + kind);
    return {kind == "rayleigh" ? PhaseKind::rayleigh : PhaseKind::henyey_greenstein, g};
}

Vec3f row(const Floats& a, py::ssize_t i) {
    const float* p = a.data() + 3 * (a.shape(0) == 1 ? 0 : i);  // one for all
    return {p[0], p[1], p[2]};
}

Doubles phase_densities(const std::string& kind, float g, const Floats& a, const Floats& b) {
    const PhaseFunction phase = phase_function(kind, g);
    Doubles out(b.shape(0));
    for (py::ssize_t i = 0; i < b.shape(0); ++i) out.mutable_at(i) = phase(row(a, i), row(b, i));
    return out;
}

Floats phase_samples(const std::string& kind, float g, const Floats& known, const Floats& u) {
    const PhaseFunction phase = phase_function(kind, g);
    Floats out({u.shape(0), py::ssize_t(3)});
    for (py::ssize_t i = 0; i < u.shape(0); ++i) {
        const Vec3f d = phase.sample(row(known, i), {u.at(i, 0), u.at(i, 1)});
        for (int axis = 0; axis < 3; ++axis)
            out.mutable_at(i, axis) = axis == 0 ? d.x : axis == 1 ? d.y : d.z;
    }
    return out;
}

Ray ray_of(const Scene& scene, const Doubles& origins, const Floats& directions, py::ssize_t i,
           float length, float time) {
    const double* o = origins.data() + 3 * (origins.shape(0) == 1 ? 0 : i);
    return {to_float(Vec3d{o[0], o[1], o[2]} - scene.origin), 0, row(directions, i), length, time};
}

// Of rays: by channel, the optical depths, and the chance that no collision is sampled.
py::tuple optical_depths(const Scene& scene, const Doubles& origins, const Floats& directions,
                         const Floats& lengths, float time) {
    const FlushDenormals flush;
    const py::ssize_t n = directions.shape(0);
    Media::Scratch scratch;
    Doubles depths({n, py::ssize_t(3)}), probability(n);
    for (py::ssize_t i = 0; i < n; ++i) {
        const OpticalDepth depth = optical_depth(
            scene.media, ray_of(scene, origins, directions, i, lengths.at(i), time), scratch);
        for (int c = 0; c < 3; ++c) depths.mutable_at(i, c) = depth.all[c];
        probability.mutable_at(i) = Attenuation(depth).probability();
    }
    return py::make_tuple(depths, probability);
}

// Distances, infinite where a ray reaches its end.
Doubles collisions(const Scene& scene, const Doubles& origin, const Floats& direction, float length,
                   int count, uint64_t seed, float time) {
    const FlushDenormals flush;
    Media::Scratch scratch;
    RandomStream random(seed);
    Doubles out(count);
    const Ray ray = ray_of(scene, origin, direction, 0, length, time);
    for (int i = 0; i < count; ++i) {
        const Collision collision = sample_collision(scene.media, ray, random, scratch);
        out.mutable_at(i) =
            collision.medium ? double(collision.t) : std::numeric_limits<double>::infinity();
    }
    return out;
}

}  // namespace

void bind_media(py::module_& module) {
    module.def("phase_densities", &phase_densities, py::arg("kind"), py::arg("g"), py::arg("a"),
               py::arg("b"), "Per solid angle; (n, 3) unit directions that leave the point.");
    module.def("phase_samples", &phase_samples, py::arg("kind"), py::arg("g"), py::arg("known"),
               py::arg("u"), "(n, 3) directions of (n, 2) uniform numbers.");
    module.def("optical_depths", &optical_depths, py::arg("scene"), py::arg("origins"),
               py::arg("directions"), py::arg("lengths"), py::arg("time") = 0.0f,
               "Of rays: (n, 3) optical depths, and (n,) chances that no collision is sampled.");
    module.def("collisions", &collisions, py::arg("scene"), py::arg("origin"), py::arg("direction"),
               py::arg("length"), py::arg("count"), py::arg("seed") = 0, py::arg("time") = 0.0f,
               "Sampled distances along a ray to where it collides, inf where it does not.");
}

}  // namespace usdmlt
