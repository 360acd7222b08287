// Motion: values at equidistant times of the shutter's interval, linear in between.
//
// Time is a dimension of a path: in [0, 1], from the shutter's opening to its closing, the same for
// all its vertices, and 0 where nothing moves. Paths are made with its density 1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "base/frame.hpp"

namespace usdmlt {

// Between which of `count` ≥ 2 values a time lies, and how far.
struct TimeSegment {
    size_t first;
    float fraction;

    TimeSegment(float time, size_t count) {
        const float position = time * float(count - 1);
        const float segment = std::min(std::floor(position), float(count - 2));
        first = static_cast<size_t>(segment);
        fraction = position - segment;
    }
};

inline Vec3f interpolate(Vec3f a, Vec3f b, float fraction) {
    return a * (1 - fraction) + b * fraction;
}

// Of the matrices, as UsdGeom and the acceleration structure interpolate transforms.
inline Affine3f interpolate(const Affine3f& a, const Affine3f& b, float fraction) {
    return {interpolate(a.x, b.x, fraction), interpolate(a.y, b.y, fraction),
            interpolate(a.z, b.z, fraction), interpolate(a.origin, b.origin, fraction)};
}

// `first` at the shutter's opening, `later` at the further times; empty: it does not move.
inline Affine3f transform_at(const Affine3f& first, std::span<const Affine3f> later, float time) {
    if (later.empty()) return first;
    const TimeSegment t(time, later.size() + 1);
    return interpolate(t.first == 0 ? first : later[t.first - 1], later[t.first], t.fraction);
}

}  // namespace usdmlt
