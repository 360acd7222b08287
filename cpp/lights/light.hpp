// What paths ask of lights. A light point is a path's x0: a point of an emitting surface, or a
// direction for lights at infinity.
//
// Densities of x0 are in area measure, or in solid angle for a direction at infinity; the choice
// of the light is part of them. All infinite lights that are not Dirac (domes and distant lights
// with an extent) act as one environment: its radiance is their sum, its density their mixture, so
// that one escaping direction is one x0. Distant lights of angle 0 are Dirac: `delta`, the density
// is the discrete probability of the light, the radiance its irradiance.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/spectrum.hpp"
#include "base/vec.hpp"

namespace usdmlt {

struct LightPoint {
    Vec3f position;      // surface lights, recentred world space
    Vec3f normal;        // surface lights: geometric; one-sided lights emit on the side of +normal
    Vec3f direction;     // at infinity: unit, from the scene towards the light
    Vec2f uv;            // parameters of the surface point (barycentrics for meshes)
    uint32_t light = 0;  // index of the light; for the environment: environment_light
    uint32_t primitive = 0;  // triangle, for meshes
    float time = 0;          // lights may move; see motion.hpp
    bool infinite = false;
    bool delta = false;  // direction at infinity is Dirac
};

inline constexpr uint32_t environment_light = 0xfffffffeu;

// What lights are chosen and sampled by. Positive wherever the radiance is not zero, also outside
// the gamut.
inline double importance(const Spectrum& s) {
    const auto magnitude = [&](int c) { return double(std::fabs(s[c])); };
    return luminance(magnitude(0), magnitude(1), magnitude(2));
}

}  // namespace usdmlt
