// Lights from Python's scene description, and a probe for tests.
#pragma once

#include <pybind11/pybind11.h>

#include "lights/lights.hpp"

namespace usdmlt {

// `lights`: light dataclasses of scene.py; `center`: the core's origin in the world; `textures`:
// what the lights' texture indices mean, which must outlive the result. Not finished yet, so that
// emissive meshes can be added. Throws std::invalid_argument with the light's name.
Lights lights_from_python(const pybind11::list& lights, Vec3d center,
                          const std::vector<Texture>& textures);

// The `transform` of a scene.py object, a row-vector 4×4 matrix local to world, relative to
// `center`: recentred before it becomes float.
Affine3f recentred_transform(const pybind11::handle& object, Vec3d center);

void bind_lights(pybind11::module_& module);

}  // namespace usdmlt
