// Pixel filters by filter importance sampling (Ernst, Stamminger & Greiner 2006).
//
// A sample of a pixel lies at: uniform point of the pixel + offset ~ h. The filter is therefore
// box ⊛ h, and its adjoint is exact: a splat at raster point r belongs to the pixel that contains
// r − offset, offset ~ h. Camera samples and splats see the same filter, also at the image's edge.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/vec.hpp"

namespace usdmlt {

struct PixelFilter {
    enum class Kind : uint8_t { box, gaussian };
    Kind kind = Kind::gaussian;
    float sigma = 0.35f;  // of h, in pixels; the whole filter has σ² + 1/12

    // How far outside the image a sample can lie and still belong to a pixel.
    float reach() const {
        return kind == Kind::box ? 0 : sigma * std::sqrt(2 * 12 * std::log(2.0f));
    }

    // Box–Muller, cut at 4σ by the range of the uniform number.
    Vec2f offset(Vec2f u) const {
        if (kind == Kind::box) return {0, 0};
        const float r = sigma * std::sqrt(-2 * std::log(1 - u.x * (1 - 0x1p-12f)));
        return {r * std::cos(2 * pi * u.y), r * std::sin(2 * pi * u.y)};
    }
};

}  // namespace usdmlt
