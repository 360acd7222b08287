// What a path of bidirectional path tracing gives to the layers of a film.
#pragma once

#include "integrators/strategies.hpp"
#include "paths/light_path_classes.hpp"

namespace usdmlt {

// Adds the parts of `value`, which the path of one strategy has, to `sums`.
inline void add_to_layers(const StrategySample& path, const Spectrum& value,
                          LightPathClasses& classes, LayerSums& sums) {
    const Subpath &camera = path.camera, &light = path.light;
    const int s = path.s, t = path.t;
    const Vec3f joined = s > 0 ? direction_to(light[s - 1], camera[t - 1]) : Vec3f{};  // to the eye
    classes.begin();
    for (int i = 1; i < (s > 0 ? t : t - 1); ++i) {
        const SubpathVertex& v = camera[i];
        const bool joins = i == t - 1;
        const Vec3f to_light = joins ? -joined : -camera[i + 1].to_previous;
        classes.scatter(
            scattering_event(v, to_light, v.to_previous, joins ? non_delta : v.component));
    }
    for (int i = s - 1; i > 0; --i) {
        const SubpathVertex& v = light[i];
        const bool joins = i == s - 1;
        const Vec3f to_eye = joins ? joined : -light[i + 1].to_previous;
        classes.scatter(
            scattering_event(v, v.to_previous, to_eye, joins ? non_delta : v.component));
    }
    if (s == 0)
        classes.end(camera[t - 1], camera[t - 2], camera[t - 1].to_previous, value, sums);
    else if (s == 1)
        classes.end(light[0], camera[t - 1], joined, value, sums);
    else
        classes.end(light[0], light[1], -light[1].to_previous, value, sums);
}

// The same for what media add on an edge of a camera subpath.
inline void add_glow_to_layers(const Subpath& camera, int edges, const Spectrum& value,
                               LightPathClasses& classes, LayerSums& sums) {
    classes.begin();
    for (int i = 1; i < edges; ++i) {
        const SubpathVertex& v = camera[i];
        const Vec3f to_light =
            i + 1 < camera.count ? -camera[i + 1].to_previous : camera.last_direction;
        classes.scatter(scattering_event(v, to_light, v.to_previous, v.component));
    }
    classes.end_in_medium(value, sums);
}

}  // namespace usdmlt
