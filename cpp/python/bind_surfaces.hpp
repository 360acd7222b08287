// Polygons and subdivision surfaces, for the readers of stages: the submodule `surfaces`.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_surfaces(pybind11::module_& module);

}  // namespace usdmlt
