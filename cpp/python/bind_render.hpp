// Renders, for Python.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_render(pybind11::module_& module);

}  // namespace usdmlt
