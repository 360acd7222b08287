// Phase functions: the density, per solid angle, of the direction in which a medium scatters.
//
// Both directions point away from the point, as those of closures do: light goes along −to_light
// before and to_eye afterwards, so cosθ = −to_light · to_eye, and 1 is straight on.
#pragma once

#include <cmath>

#include "base/frame.hpp"
#include "base/warps.hpp"

namespace usdmlt {

enum class PhaseKind : uint8_t { henyey_greenstein, rayleigh };

struct PhaseFunction {
    PhaseKind kind = PhaseKind::henyey_greenstein;
    float g = 0;  // mean cosine, −1 < g < 1; 0: isotropic

    // Henyey & Greenstein (1941): (1 − g²) / (4π (1 + g² − 2 g cosθ)^{3/2});
    // Rayleigh: 3 (1 + cos²θ) / (16π).
    float operator()(Vec3f a, Vec3f b) const {
        const float cosine = -dot(a, b);
        if (kind == PhaseKind::rayleigh) return (0.1875f * inv_pi) * (1 + cosine * cosine);
        const float d = std::max(1 + g * g - 2 * g * cosine, 1e-12f);
        return 0.25f * inv_pi * (1 - g * g) / (d * std::sqrt(d));
    }

    // The other direction, with the density that operator() tells.
    Vec3f sample(Vec3f known, Vec2f u) const {
        float cosine;
        if (kind == PhaseKind::rayleigh) {
            // (cos³θ + 3 cosθ + 4) / 8 = u, by Cardano.
            const double q = 4 * double(u.x) - 2, a = std::cbrt(q + std::sqrt(q * q + 1));
            cosine = static_cast<float>(a - 1 / a);
        } else if (std::fabs(g) < 1e-3f) {
            cosine = 1 - 2 * u.x;
        } else {
            const float s = (1 - g * g) / (1 - g + 2 * g * u.x);
            cosine = (1 + g * g - s * s) / (2 * g);
        }
        cosine = std::clamp(cosine, -1.0f, 1.0f);
        const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine)), phi = 2 * pi * u.y;
        const Frame frame = Frame::from_normal(-known);
        return normalize(frame.x * (sine * std::cos(phi)) + frame.y * (sine * std::sin(phi)) +
                         frame.z * cosine);
    }
};

}  // namespace usdmlt
