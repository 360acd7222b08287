// Layers of a picture: light paths by expressions, and what the camera's rays meet.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>

#include "paths/light_path_classes.hpp"

namespace usdmlt {

// Of a usdmlt.light_path_layers.LightPathLayers; null of None.
std::shared_ptr<const LightPathAutomaton> automaton_from_python(const Scene& scene,
                                                                const pybind11::object& source);

void bind_layers(pybind11::module_& module);

}  // namespace usdmlt
