// UsdLux ShapingAPI: how a surface light's radiance depends on the angle θ between the direction
// of emission and the light's −z axis. With c = cosθ,
//     S = lerp(focusTint, 1, |c|^focus) · (1 − smoothstep(θ; (1 − softness)·angle, angle)) · I(θ,
//     φ)
// with I an IES profile, if there is one, at the azimuth φ of the direction against which light is
// emitted, about local +z from +x towards +y (as hdEmbree has it).
#pragma once

#include <vector>

#include "base/distribution.hpp"
#include "base/frame.hpp"
#include "base/spectrum.hpp"
#include "base/vec.hpp"
#include "lights/ies_profile.hpp"

namespace usdmlt {

struct ShapingParameters {
    float focus = 0;
    Spectrum focus_tint;
    float cone_angle_degrees = 90;  // half-angle
    float cone_softness = 0;
    IesProfile profile;  // empty: none
};

class Shaping {
public:
    Shaping() = default;  // S = 1
    // `to_world`: of the light. `flat`: the light's normal is the axis everywhere; then the sampled
    // density takes in the cosine at the surface.
    Shaping(const ShapingParameters& parameters, const Affine3f& to_world, bool flat);

    bool active() const { return active_; }
    Vec3f axis() const { return axis_; }
    float angle() const { return angle_; }  // radians; black beyond

    Spectrum evaluate(Vec3f direction) const;

    // Samples directions by θ in bins of equal angle, with a density in solid angle that is
    // constant in each bin, follows the importance of S, averaged over φ, and is positive wherever
    // S is.
    Vec3f sample(Vec2f u) const;
    double pdf(Vec3f direction) const;

    // Share of a light's directions that should be sampled by S; the rest by the cosine at the
    // surface.
    float share() const { return share_; }

private:
    Spectrum at_angle(float theta) const;  // without the profile
    double average_importance(float theta) const;
    float profile_at(float theta, Vec3f direction) const;
    float angle_to(Vec3f direction) const;

    bool active_ = false;
    Vec3f axis_{0, 0, -1};
    Vec3f azimuth_x_, azimuth_y_;  // perpendicular to the axis
    IesProfile profile_;
    float focus_ = 0;
    Spectrum focus_tint_;
    float angle_ = pi, inner_angle_ = pi;  // fades from the inner angle to the angle
    float sampled_angle_ = 0;              // the bins cover [0, sampled angle]
    float share_ = 0;
    DiscreteDistribution bins_;
    std::vector<double> density_;  // of each bin
};

}  // namespace usdmlt
