// Lights that move keep their shape: they are carried rigidly from where they are at the shutter's
// opening,
//     p(t) = place(t) + R(t)·(p − pivot),
// so that densities and radiance are those at the opening, asked in the frame of that time. Place
// and rotation matrix are linear between equidistant times, the matrix made orthonormal again.
#pragma once

#include <utility>
#include <vector>

#include "geometry/motion.hpp"

namespace usdmlt {

// From the opening to a time; the default stays.
struct LightPose {
    Frame rotation;  // images of the axes
    Vec3f pivot, place;
    bool moved = false;

    Vec3f vector(Vec3f v) const { return moved ? rotation.to_world(v) : v; }
    Vec3f point(Vec3f p) const { return moved ? place + rotation.to_world(p - pivot) : p; }
    Vec3f to_opening(Vec3f v) const { return moved ? rotation.to_local(v) : v; }
    Vec3f point_to_opening(Vec3f p) const {
        return moved ? pivot + rotation.to_local(p - place) : p;
    }
};

struct LightMotion {
    std::vector<Affine3f> steps;  // R and place, the opening (identity, pivot) first

    LightPose at(float time) const {
        const TimeSegment t(time, steps.size());
        const Affine3f m = interpolate(steps[t.first], steps[t.first + 1], t.fraction);
        LightPose pose;
        pose.rotation = orthonormal(m);
        pose.pivot = steps[0].origin;
        pose.place = m.origin;
        pose.moved = true;
        return pose;
    }

    // `first`: the light's transform at the opening, regular; `later`: at the further times.
    LightMotion(const Affine3f& first, const std::vector<Affine3f>& later) {
        Affine3f to_local = first;
        to_local.origin = {};
        to_local = to_local.inverse();
        const auto turned = [&](const Affine3f& m, Vec3f axis) {
            const Vec3f local = to_local.vector(axis);
            return m.x * local.x + m.y * local.y + m.z * local.z;
        };
        steps.push_back({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, first.origin});
        for (const Affine3f& m : later) {
            const Frame r = orthonormal({turned(m, {1, 0, 0}), turned(m, {0, 1, 0}), {}, {}});
            steps.push_back({r.x, r.y, r.z, m.origin});
        }
    }

    static Frame orthonormal(const Affine3f& m) {
        const Vec3f x = normalize(m.x), y = normalize(m.y - x * dot(m.y, x));
        return {x, y, cross(x, y)};
    }
};

}  // namespace usdmlt
