// Probes of the path functions, for tests.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_paths(pybind11::module_& module);

}  // namespace usdmlt
