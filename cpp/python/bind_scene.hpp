// Scenes from Python's scene description (usdmlt.scene).
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_scene(pybind11::module_& module);

}  // namespace usdmlt
