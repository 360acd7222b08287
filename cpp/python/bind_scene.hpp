// Scenes from Python's scene description (usdmlt.scene).
#pragma once

#include <pybind11/pybind11.h>

#include "geometry/mesh.hpp"

namespace usdmlt {

// A scene.Mesh with its transform applied; `primvar_slots` by name. Read
// closures.compile_materials for slots.
Mesh mesh_from_python(const pybind11::handle& source, const pybind11::dict& primvar_slots);

void bind_scene(pybind11::module_& module);

}  // namespace usdmlt
