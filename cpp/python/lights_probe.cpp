// A probe of the lights' functions for tests: all of them over arrays. Light points are a
// structured array with the fields of LightPoint.
#include <pybind11/numpy.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "python/bind_lights.hpp"
#include "python/bind_materials.hpp"

namespace py = pybind11;

namespace usdmlt {

namespace {

using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;
using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;
using IndexArray = py::array_t<uint32_t, py::array::c_style | py::array::forcecast>;

py::dtype light_point_dtype() {
    py::list names, formats, offsets;
    const auto field = [&](const char* name, const py::object& format, size_t offset) {
        names.append(name);
        formats.append(format);
        offsets.append(offset);
    };
    const auto vector = [](int n) { return py::make_tuple("f4", n); };
    field("position", vector(3), offsetof(LightPoint, position));
    field("normal", vector(3), offsetof(LightPoint, normal));
    field("direction", vector(3), offsetof(LightPoint, direction));
    field("uv", vector(2), offsetof(LightPoint, uv));
    field("light", py::str("u4"), offsetof(LightPoint, light));
    field("primitive", py::str("u4"), offsetof(LightPoint, primitive));
    field("infinite", py::str("?"), offsetof(LightPoint, infinite));
    field("delta", py::str("?"), offsetof(LightPoint, delta));
    return py::dtype(names, formats, offsets, sizeof(LightPoint));
}

py::array new_points(py::ssize_t count) {
    py::array points(light_point_dtype(), count);
    auto* p = static_cast<LightPoint*>(points.mutable_data());
    std::fill(p, p + count, LightPoint{});
    return points;
}

const LightPoint* points_of(const py::array& points) {
    if (!points.dtype().equal(light_point_dtype()) || !(points.flags() & py::array::c_style))
        throw std::invalid_argument("not a contiguous array of light points");
    return static_cast<const LightPoint*>(points.data());
}

Vec3f vec3(const FloatArray& a, py::ssize_t i) {
    const float* p = a.data() + 3 * (a.shape(0) == 1 ? 0 : i);  // one for all
    return {p[0], p[1], p[2]};
}
Vec2f vec2(const FloatArray& a, py::ssize_t i) { return {a.at(i, 0), a.at(i, 1)}; }

FloatArray new_vectors(py::ssize_t count, py::ssize_t width) {
    FloatArray a(std::vector<py::ssize_t>{count, width});
    std::fill(a.mutable_data(), a.mutable_data() + a.size(), 0.0f);
    return a;
}
void set(FloatArray& a, py::ssize_t i, Vec3f v) {
    float* p = a.mutable_data() + 3 * i;
    p[0] = v.x;
    p[1] = v.y;
    p[2] = v.z;
}

// Emissive meshes for the probe: points, triangles, materials and one primvar slot, "st".
Mesh mesh_from_python(const py::handle& object) {
    Mesh mesh;
    const auto points = py::cast<FloatArray>(object.attr("points"));
    for (py::ssize_t i = 0; i < points.shape(0); ++i) mesh.positions.push_back(vec3(points, i));
    const auto triangles = py::cast<IndexArray>(object.attr("triangles"));
    std::vector<Triangle> corners;
    for (py::ssize_t i = 0; i < triangles.shape(0); ++i)
        corners.push_back({{triangles.at(i, 0), triangles.at(i, 1), triangles.at(i, 2)}});
    mesh.triangles = std::move(corners);
    if (py::isinstance<py::int_>(object.attr("materials"))) {
        mesh.material = py::cast<uint32_t>(object.attr("materials"));
    } else {
        const auto materials = py::cast<IndexArray>(object.attr("materials"));
        mesh.triangle_materials =
            std::vector<uint32_t>(materials.data(), materials.data() + materials.size());
    }
    const auto primvars = py::cast<py::dict>(object.attr("primvars"));
    if (primvars.contains("st")) {
        const auto values = py::cast<FloatArray>(primvars["st"].attr("values"));
        mesh.primvars.emplace_back();
        mesh.primvars.back().width = static_cast<int>(values.shape(1));
        mesh.primvars.back().values =
            std::vector<float>(values.data(), values.data() + values.size());
    }
    return mesh;
}

struct LightsProbe {
    Materials materials;
    std::vector<Mesh> meshes;
    Lights lights;
    float time = 0;

    LightsProbe(const py::list& python_lights, std::tuple<double, double, double> center,
                float radius, const py::list& textures, const py::list& compiled_materials,
                const py::list& python_meshes)
        : materials(materials_from_python(textures, compiled_materials)) {
        const Vec3d c{std::get<0>(center), std::get<1>(center), std::get<2>(center)};
        lights = lights_from_python(python_lights, c, materials.textures);
        for (const py::handle mesh : python_meshes) meshes.push_back(mesh_from_python(mesh));
        for (size_t i = 0; i < meshes.size(); ++i)
            add_mesh(lights, meshes[i], recentred_transform(python_meshes[i], c), {}, materials);
        lights.finish({0, 0, 0}, radius);
    }

    // (n, 3) uniform numbers: u_select, u.
    template <typename Sample>
    static py::tuple sample_points(const FloatArray& u, const Sample& sample) {
        const py::ssize_t n = u.shape(0);
        py::array points = new_points(n);
        DoubleArray pdf(n);
        for (py::ssize_t i = 0; i < n; ++i) {
            LightPoint point;
            double density = 0;
            if (!sample(i, u.at(i, 0), Vec2f{u.at(i, 1), u.at(i, 2)}, point, density)) density = 0;
            static_cast<LightPoint*>(points.mutable_data())[i] = point;
            pdf.mutable_at(i) = density;
        }
        return py::make_tuple(points, pdf);
    }

    template <typename Density>
    static DoubleArray densities(py::ssize_t n, const Density& density) {
        DoubleArray pdf(n);
        for (py::ssize_t i = 0; i < n; ++i) pdf.mutable_at(i) = density(i);
        return pdf;
    }

    py::tuple point_samples(const FloatArray& u) const {
        return sample_points(u, [&](auto, float s, Vec2f v, LightPoint& point, double& pdf) {
            return sample_point(lights, s, v, time, point, pdf);
        });
    }
    DoubleArray point_pdf(const py::array& points) const {
        const LightPoint* p = points_of(points);
        return densities(points.size(), [&](auto i) { return pdf_point(lights, p[i]); });
    }
    py::tuple direct_samples(const FloatArray& references, const FloatArray& u) const {
        return sample_points(u, [&](auto i, float s, Vec2f v, LightPoint& point, double& pdf) {
            return sample_direct(lights, vec3(references, i), s, v, time, point, pdf);
        });
    }
    DoubleArray direct_pdf(const py::array& points, const FloatArray& references) const {
        const LightPoint* p = points_of(points);
        return densities(points.size(),
                         [&](auto i) { return pdf_direct(lights, p[i], vec3(references, i)); });
    }

    FloatArray emitted(const py::array& points, const FloatArray& directions) const {
        const LightPoint* p = points_of(points);
        FloatArray out = new_vectors(points.size(), 3);
        for (py::ssize_t i = 0; i < points.size(); ++i) {
            const Spectrum s = radiance(lights, p[i], vec3(directions, i));
            set(out, i, {s[0], s[1], s[2]});
        }
        return out;
    }

    py::tuple direction_samples(const py::array& points, const FloatArray& u) const {
        const LightPoint* p = points_of(points);
        const py::ssize_t n = u.shape(0);
        FloatArray directions = new_vectors(n, 3);
        DoubleArray pdf(n);
        for (py::ssize_t i = 0; i < n; ++i) {
            Vec3f direction;
            double density = 0;
            const LightPoint& point = p[points.size() == 1 ? 0 : i];
            if (!sample_direction(lights, point, vec2(u, i), direction, density)) density = 0;
            set(directions, i, direction);
            pdf.mutable_at(i) = density;
        }
        return py::make_tuple(directions, pdf);
    }
    DoubleArray direction_pdf(const py::array& points, const FloatArray& directions) const {
        const LightPoint* p = points_of(points);
        return densities(directions.shape(0), [&](auto i) {
            return pdf_direction(lights, p[points.size() == 1 ? 0 : i], vec3(directions, i));
        });
    }

    py::tuple origin_samples(const FloatArray& directions, const FloatArray& u) const {
        const py::ssize_t n = u.shape(0);
        FloatArray origins = new_vectors(n, 3);
        DoubleArray pdf(n);
        for (py::ssize_t i = 0; i < n; ++i) {
            Vec3f origin;
            double density = 0;
            sample_origin(lights, vec3(directions, i), vec2(u, i), origin, density);
            set(origins, i, origin);
            pdf.mutable_at(i) = density;
        }
        return py::make_tuple(origins, pdf);
    }

    py::array environment_points(const FloatArray& directions) const {
        py::array points = new_points(directions.shape(0));
        auto* p = static_cast<LightPoint*>(points.mutable_data());
        for (py::ssize_t i = 0; i < points.size(); ++i)
            if (!environment_point(lights, vec3(directions, i), time, p[i]))
                throw std::invalid_argument("no environment");
        return points;
    }

    py::tuple bounds_of(int shape) const {
        FloatArray box = new_vectors(2, 3);
        Vec3f lower, upper;
        shape_bounds(lights, shape, lower, upper);
        set(box, 0, lower);
        set(box, 1, upper);
        return py::make_tuple(box[py::int_(0)], box[py::int_(1)]);
    }

    // t is infinite where the shape is missed.
    py::tuple intersections(int shape, const FloatArray& origins, const FloatArray& directions,
                            float tnear, float tfar) const {
        const py::ssize_t n = directions.shape(0);
        FloatArray distances(n), uvs = new_vectors(n, 2);
        for (py::ssize_t i = 0; i < n; ++i) {
            float t = std::numeric_limits<float>::infinity();
            Vec2f uv;
            intersect_shape(lights, shape, vec3(origins, i), vec3(directions, i), time, tnear, tfar,
                            t, uv);
            distances.mutable_at(i) = t;
            uvs.mutable_at(i, 0) = uv.x;
            uvs.mutable_at(i, 1) = uv.y;
        }
        return py::make_tuple(distances, uvs);
    }

    py::array shape_points(int shape, const FloatArray& uv) const {
        py::array points = new_points(uv.shape(0));
        auto* p = static_cast<LightPoint*>(points.mutable_data());
        for (py::ssize_t i = 0; i < points.size(); ++i)
            p[i] = shape_point(lights, shape, vec2(uv, i), time);
        return points;
    }
    py::array mesh_points(uint32_t light, const IndexArray& triangles, const FloatArray& uv) const {
        py::array points = new_points(uv.shape(0));
        auto* p = static_cast<LightPoint*>(points.mutable_data());
        for (py::ssize_t i = 0; i < points.size(); ++i)
            p[i] = mesh_point(lights, light, triangles.at(i), uv.at(i, 0), uv.at(i, 1), time);
        return points;
    }
};

}  // namespace

void bind_lights(py::module_& module) {
    using namespace py::literals;
    py::class_<LightsProbe>(
        module, "LightsProbe",
        "The lights of scene.py as the core has them; a probe for tests.\n\n"
        "Directions, positions and uniform numbers are (n, 3) or (n, 2) float arrays; positions\n"
        "are relative to ``center``; light points are a structured array. Samplers return density\n"
        "0 where there is no sample. ``radius`` bounds the scene about ``center``.")
        .def(py::init<const py::list&, std::tuple<double, double, double>, float, const py::list&,
                      const py::list&, const py::list&>(),
             "lights"_a, "center"_a = py::make_tuple(0.0, 0.0, 0.0), "radius"_a = 1.0f,
             "textures"_a = py::list(), "materials"_a = py::list(), "meshes"_a = py::list())
        .def_readwrite("time", &LightsProbe::time)
        .def_property_readonly("power",
                               [](const LightsProbe& p) {
                                   return DoubleArray(p.lights.power.size(), p.lights.power.data());
                               })
        .def("sample_point", &LightsProbe::point_samples, "u"_a)
        .def("pdf_point", &LightsProbe::point_pdf, "points"_a)
        .def("sample_direct", &LightsProbe::direct_samples, "reference"_a, "u"_a)
        .def("pdf_direct", &LightsProbe::direct_pdf, "points"_a, "reference"_a)
        .def("radiance", &LightsProbe::emitted, "points"_a, "direction"_a)
        .def("sample_direction", &LightsProbe::direction_samples, "points"_a, "u"_a)
        .def("pdf_direction", &LightsProbe::direction_pdf, "points"_a, "direction"_a)
        .def("sample_origin", &LightsProbe::origin_samples, "direction"_a, "u"_a)
        .def("environment_point", &LightsProbe::environment_points, "direction"_a)
        .def_property_readonly("has_environment",
                               [](const LightsProbe& p) {
                                   LightPoint point;
                                   return environment_point(p.lights, {0, 0, 1}, 0, point);
                               })
        .def_property_readonly("shape_count",
                               [](const LightsProbe& p) { return shape_count(p.lights); })
        .def("shape_bounds", &LightsProbe::bounds_of, "shape"_a)
        .def("intersect_shape", &LightsProbe::intersections, "shape"_a, "origin"_a, "direction"_a,
             "tnear"_a = 0.0f, "tfar"_a = std::numeric_limits<float>::infinity())
        .def("shape_point", &LightsProbe::shape_points, "shape"_a, "uv"_a)
        .def("mesh_point", &LightsProbe::mesh_points, "light"_a, "triangle"_a, "uv"_a);
}

}  // namespace usdmlt
