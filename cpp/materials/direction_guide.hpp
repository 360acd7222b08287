// A guide to where light comes from at a point: a few directions, each with a narrow cone about it
// and a wide one, for light that those who made the guide did not meet.
//
// With probability `share` a direction is drawn from the cones, uniform in a cone of a direction
// that is chosen alike; else by the closure. The density of the closure's non-Dirac component is
// then the mixture of the two. A guide makes no difference to f, only to what is sampled.
#pragma once

#include "base/frame.hpp"
#include "base/warps.hpp"

namespace usdmlt {

struct DirectionGuide {
    static constexpr int capacity = 32;
    static constexpr float share = 0.5f;
    static constexpr float wide_share = 0.15f, widening = 16;  // of 1 − cosθ

    int count = 0;
    float x[capacity], y[capacity], z[capacity];  // unit; those unused are far from all that are
    // Of each direction: squared chords 2 (1 − cosθ) of its cones' half angles, and their densities
    // by solid angle, 1 / (2π (1 − cosθ)), times their share.
    float narrow[capacity], narrow_density[capacity];
    float wide[capacity], wide_density[capacity];

    void set_cone(int i, float one_minus_cos) {
        const float wider = std::min(one_minus_cos * widening, 1.0f);
        narrow[i] = 2 * one_minus_cos;
        wide[i] = 2 * wider;
        narrow_density[i] = (1 - wide_share) / (2 * pi * one_minus_cos);
        wide_density[i] = wide_share / (2 * pi * wider);
    }

    // Mean of the cones' densities, in solid angle.
    float pdf(Vec3f w) const {
        // 1 − cos of small angles by |a − b|² / 2, which keeps its digits.
        float sum = 0;
        for (int i = 0; i < capacity; ++i) {
            const float dx = x[i] - w.x, dy = y[i] - w.y, dz = z[i] - w.z;
            const float chord = dx * dx + dy * dy + dz * dz;
            sum += chord < narrow[i] ? narrow_density[i] : 0.0f;
            sum += chord < wide[i] ? wide_density[i] : 0.0f;
        }
        return sum / static_cast<float>(count);
    }

    // u_choice: in [0, 1).
    Vec3f sample(float u_choice, Vec2f u) const {
        const float choice = u_choice * static_cast<float>(count);
        const int i = std::min(static_cast<int>(choice), count - 1);
        const bool is_wide = choice - static_cast<float>(i) < wide_share;
        return Frame::from_normal({x[i], y[i], z[i]})
            .to_world(square_to_cone(u, (is_wide ? wide[i] : narrow[i]) / 2));
    }
};

}  // namespace usdmlt
