// What of a scene is Dirac. Light of one exact direction that a Dirac surface sends to a diffuse
// one and that is seen by way of a Dirac surface again, L S+ D … S+ E, has density zero under every
// technique: S cannot be connected, and neither such a light nor the lens can be hit.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.hpp"

namespace usdmlt {

// Lights of one direction, by index, that are not black.
std::vector<uint32_t> dirac_lights(const Scene& scene);

// Materials of the scene's meshes with a Dirac lobe, by index. A material whose inputs vary is
// looked at in the middle of the first triangle that has it.
std::vector<uint32_t> dirac_materials(const Scene& scene);

}  // namespace usdmlt
