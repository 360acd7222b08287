// Bindings of what is asked of an Embree library itself.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_embree(pybind11::module_& module);

}  // namespace usdmlt
