// Films and what makes pictures of them: for what is summed over renders.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_film(pybind11::module_& module);

}  // namespace usdmlt
