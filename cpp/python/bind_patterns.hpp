// Pattern programs over whole meshes, for what is made of them before rendering.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_patterns(pybind11::module_& module);

}  // namespace usdmlt
