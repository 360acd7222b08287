#include "python/bind_patterns.hpp"

#include <pybind11/numpy.h>

#include "python/bind_materials.hpp"
#include "python/bind_scene.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

// A material's coverage as its program computes it, unclamped, at the corners of triangles: the
// way in for any one input.
py::array_t<float> coverage_at_corners(const py::list& textures, const py::dict& compiled_material,
                                       const py::dict& primvar_slots, const py::object& mesh) {
    py::list compiled;
    compiled.append(compiled_material);
    const Materials materials = materials_from_python(textures, compiled);
    const Material& material = materials.materials[0];
    const Mesh geometry = mesh_from_python(mesh, primvar_slots);
    py::array_t<float> values({py::ssize_t(geometry.triangles.size()), py::ssize_t(3)});
    float* out = values.mutable_data();
    {
        const py::gil_scoped_release release;
        for (uint32_t t = 0; t < geometry.triangles.size(); ++t)
            for (int corner = 0; corner < 3; ++corner) {
                const MeshPoint point{geometry, t, corner == 1 ? 1.0f : 0.0f,
                                      corner == 2 ? 1.0f : 0.0f};
                *out++ =
                    Values(material.program, materials.textures, point, material.opacity_schedule)
                        .number(material.opacity);
            }
    }
    return values;
}

}  // namespace

void bind_patterns(py::module_& module) {
    module.def("coverage_at_corners", &coverage_at_corners, py::arg("textures"),
               py::arg("compiled_material"), py::arg("primvar_slots"), py::arg("mesh"),
               "The opacity input of a compiled material, unclamped, at the corners of a "
               "scene.Mesh's triangles: (triangles, 3) float32.");
}

}  // namespace usdmlt
