// Materials from Python: what python/usdmlt/closures.py compiles, and probes for tests.
#pragma once

#include <pybind11/pybind11.h>

#include "materials/material.hpp"

namespace usdmlt {

// `textures`: scene.Texture objects; `compiled_materials`: the first result of
// closures.compile_materials. Throws std::invalid_argument with the material's name.
Materials materials_from_python(const pybind11::list& textures,
                                const pybind11::list& compiled_materials);

void bind_materials(pybind11::module_& module);

}  // namespace usdmlt
