// Participating media of Python's scene description.
#pragma once

#include <pybind11/pybind11.h>

#include "scene/scene.hpp"

namespace usdmlt {

// Media, and what bounds them: every mesh that is filled, by placement, and the volumes, which have
// no surface. The scene's meshes, prototypes and materials are there; `center` is its origin.
void add_media(const pybind11::object& source, Vec3d center, Scene& scene);

}  // namespace usdmlt
