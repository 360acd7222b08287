#include "lights/distant.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/warps.hpp"

namespace usdmlt {

DistantLight::DistantLight(const Affine3f& transform, float angle_degrees)
    : frame(Frame::from_normal(normalize(transform.vector({0, 0, 1})))),
      delta(!(angle_degrees > 0)) {
    const double half = std::clamp<double>(angle_degrees, 0, 360) * (std::numbers::pi / 360);
    one_minus_cos = 2 * sqr(std::sin(0.5 * half));
}

Vec3f sample_incoming(const DistantLight& light, Vec2f u) {
    return normalize(
        light.frame.to_world(square_to_cone(u, static_cast<float>(light.one_minus_cos))));
}

double pdf_incoming(const DistantLight& light, Vec3f direction) {
    // 1 − cosθ = |d − a|²/2 keeps its precision for the angles of the sun.
    const Vec3d difference = to_double(direction) - to_double(light.frame.z);
    if (!(0.5 * dot(difference, difference) <= light.one_minus_cos)) return 0;
    return 1 / (2 * std::numbers::pi * light.one_minus_cos);
}

Spectrum incoming_radiance(const DistantLight& light, Vec3f direction) {
    return pdf_incoming(light, direction) > 0 ? light.radiance : Spectrum(0.0f);
}

Spectrum integrated_radiance(const DistantLight& light) {
    return light.delta
               ? light.radiance
               : light.radiance * static_cast<float>(2 * std::numbers::pi * light.one_minus_cos);
}

}  // namespace usdmlt
