#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

// The plain Metropolis algorithm on a grid.
void bind_metropolis(pybind11::module_& module);

}  // namespace usdmlt
