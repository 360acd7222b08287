// A guide to where light comes from at a point: a few directions, each with a narrow cone about it.
//
// With probability `share` a direction is drawn from the cones, uniform in the cone of a direction
// that is chosen alike; else by the closure. The density of the closure's non-Dirac component is
// then the mixture of the two. A guide makes no difference to f, only to what is sampled.
#pragma once

#include "base/frame.hpp"
#include "base/warps.hpp"

namespace usdmlt {

struct DirectionGuide {
    static constexpr int capacity = 32;
    static constexpr float share = 0.5f;

    int count = 0;
    float x[capacity], y[capacity], z[capacity];  // unit; those unused are far from all that are
    float one_minus_cos[capacity];                // of each cone's half angle
    float density[capacity];                      // of each cone, 1 / (2π (1 − cosθ))

    // Mean of the cones' densities, in solid angle.
    float pdf(Vec3f w) const {
        // 1 − cos of small angles by |a − b|² / 2, which keeps its digits.
        float sum = 0;
        for (int i = 0; i < capacity; ++i) {
            const float dx = x[i] - w.x, dy = y[i] - w.y, dz = z[i] - w.z;
            sum += dx * dx + dy * dy + dz * dz < 2 * one_minus_cos[i] ? density[i] : 0.0f;
        }
        return sum / static_cast<float>(count);
    }

    // u_choice: in [0, 1).
    Vec3f sample(float u_choice, Vec2f u) const {
        const int i = std::min(static_cast<int>(u_choice * static_cast<float>(count)), count - 1);
        return Frame::from_normal({x[i], y[i], z[i]}).to_world(square_to_cone(u, one_minus_cos[i]));
    }
};

}  // namespace usdmlt
