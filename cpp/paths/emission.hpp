// Le(x0 → x1): what leaves a light towards the next vertex of a path. Its only place.
#pragma once

#include "paths/vertex.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

// `direction` is unit, from x0 on. Towards any kind of receiver: see LightLinks.
inline Spectrum emission(const Scene& scene, const Vertex& x0, Vec3f direction,
                         uint32_t receiver = every_receiver) {
    if (!x0.is_seen_from(direction)) return {};
    return radiance(scene.lights, x0.light, direction, receiver);
}

// Towards x1.
inline Spectrum emission(const Scene& scene, const Vertex& x0, const Vertex& x1, Vec3f direction) {
    const uint32_t receiver = x1.is_surface() ? scene.receiver_of(x1.mesh) : every_receiver;
    return emission(scene, x0, direction, receiver);
}

}  // namespace usdmlt
