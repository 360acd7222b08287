// Le(x0 → x1): what leaves a light towards the next vertex of a path. Its only place.
#pragma once

#include "paths/vertex.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

// `direction` is unit, from x0 to x1. Light linking is in it.
inline Spectrum emission(const Scene& scene, const Vertex& x0, const Vertex& x1, Vec3f direction) {
    const uint32_t receiver = x1.is_surface() ? scene.receiver_of(x1.mesh) : every_receiver;
    return radiance(scene.lights, x0.light, direction, receiver);
}

}  // namespace usdmlt
