// Transition densities of mutations, looked at from tests.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_mutations(pybind11::module_& module);

}  // namespace usdmlt
