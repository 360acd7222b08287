// DistantLight: constant radiance from a cone about local +z; with an angle of 0 one direction,
// whose `radiance` is the irradiance on a surface that faces it.
#pragma once

#include "base/frame.hpp"
#include "base/spectrum.hpp"
#include "base/vec.hpp"

namespace usdmlt {

struct DistantLight {
    Spectrum radiance;
    Frame frame;               // z: towards the light
    double one_minus_cos = 0;  // of the half-angle
    bool delta = false;

    DistantLight() = default;
    DistantLight(const Affine3f& transform, float angle_degrees);
};

// Not for angle 0. Directions are from the scene towards the light; uniform in the cone.
Vec3f sample_incoming(const DistantLight& light, Vec2f u);
double pdf_incoming(const DistantLight& light, Vec3f direction);
Spectrum incoming_radiance(const DistantLight& light, Vec3f direction);

// ∫ L dω, or the irradiance of a Dirac light.
Spectrum integrated_radiance(const DistantLight& light);

}  // namespace usdmlt
