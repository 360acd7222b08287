// Probes of media, for tests.
#pragma once

#include <pybind11/pybind11.h>

namespace usdmlt {

void bind_media(pybind11::module_& module);

}  // namespace usdmlt
