#include "lights/shaping.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/frame.hpp"
#include "lights/light.hpp"

namespace usdmlt {

namespace {

constexpr int bin_count = 128;
constexpr int points_per_bin = 8;

// 1 − cosθ, without cancellation.
double one_minus_cos(double theta) { return 2 * sqr(std::sin(0.5 * theta)); }

}  // namespace

Shaping::Shaping(const ShapingParameters& parameters, const Affine3f& to_world, bool flat)
    : active_(true),
      axis_(normalize(to_world.vector({0, 0, -1}))),
      profile_(parameters.profile),
      focus_(std::max(parameters.focus, 0.0f)),
      focus_tint_(parameters.focus_tint),
      angle_(std::clamp(parameters.cone_angle_degrees, 0.0f, 180.0f) * (pi / 180)),
      inner_angle_(angle_ * (1 - clamp01(parameters.cone_softness))) {
    // The azimuth's axes are those of the light as far as they are perpendicular to the axis.
    const Vec3f x = to_world.vector({1, 0, 0}), y = to_world.vector({0, 1, 0});
    azimuth_x_ = normalize(x - axis_ * dot(x, axis_));
    azimuth_y_ = cross(axis_, azimuth_x_);
    if (dot(azimuth_y_, y) < 0) azimuth_y_ = -azimuth_y_;

    // Beyond the horizon a flat light does not emit.
    const double last = flat ? std::min<double>(angle_, pi / 2) : angle_;
    std::vector<double> weights(bin_count), solid_angles(bin_count);
    double integral = 0, peak = 0;
    for (int i = 0; i < bin_count; ++i) {
        for (int j = 0; j < points_per_bin; ++j) {
            const double t = (i + (j + 0.5) / points_per_bin) / bin_count;
            const double s = average_importance(static_cast<float>(t * last));
            weights[i] += s * (flat ? std::cos(t * last) : 1.0) / points_per_bin;
            peak = std::max(peak, s);
        }
        solid_angles[i] =
            2 * std::numbers::pi *
            (one_minus_cos((i + 1) * last / bin_count) - one_minus_cos(i * last / bin_count));
        weights[i] *= solid_angles[i];
        integral += weights[i];
    }
    // What a profile has between the points above is not lost.
    if (!profile_.empty())
        for (int i = 0; i < bin_count; ++i)
            weights[i] += 1e-3 * integral * solid_angles[i] / (4 * std::numbers::pi);
    bins_ = DiscreteDistribution(weights);
    if (bins_.empty()) return;
    sampled_angle_ = static_cast<float>(last);
    for (int i = 0; i < bin_count; ++i) density_.push_back(bins_.probability(i) / solid_angles[i]);
    // Narrow shapes are worth sampling by themselves, wide ones by the cosine.
    share_ =
        flat ? 1.0f : clamp01(static_cast<float>(1 - integral / (2 * std::numbers::pi * peak)));
}

float Shaping::angle_to(Vec3f direction) const {
    // |d − a| = 2 sin(θ/2): precise for small angles, where acos is not.
    return 2 * std::asin(std::min(0.5f * length(direction - axis_), 1.0f));
}

Spectrum Shaping::at_angle(float theta) const {
    if (!(theta < angle_)) return Spectrum(0.0f);
    Spectrum s(1.0f);
    if (focus_ > 0) {
        const float f = std::pow(std::fabs(std::cos(theta)), focus_);
        s = focus_tint_ + (Spectrum(1.0f) - focus_tint_) * f;
    }
    if (theta > inner_angle_) {
        const float t = (theta - inner_angle_) / (angle_ - inner_angle_);
        s *= 1 - t * t * (3 - 2 * t);
    }
    return s;
}

// Half-way between the profile's planes, between which its values are linear: the exact average.
double Shaping::average_importance(float theta) const {
    const double s = importance(at_angle(theta));
    if (profile_.empty() || s == 0) return s;
    const size_t planes = profile_.phi.size();
    if (planes == 1) return s * profile_.evaluate(theta, 0);
    double sum = 0;
    for (size_t i = 0; i + 1 < planes; ++i) {
        const float low = profile_.phi[i], high = profile_.phi[i + 1];
        sum += (high - low) * profile_.evaluate(theta, 0.5f * (low + high));
    }
    return s * sum / (2 * std::numbers::pi);
}

float Shaping::profile_at(float theta, Vec3f direction) const {
    if (profile_.empty()) return 1;
    return profile_.evaluate(theta,
                             std::atan2(-dot(direction, azimuth_y_), -dot(direction, azimuth_x_)));
}

Spectrum Shaping::evaluate(Vec3f direction) const {
    if (!active_) return Spectrum(1.0f);
    const float theta = angle_to(direction);
    return at_angle(theta) * profile_at(theta, direction);
}

Vec3f Shaping::sample(Vec2f u) const {
    if (bins_.empty()) return axis_;
    double v = u.x, probability;
    const auto i = static_cast<double>(bins_.sample(v, probability));
    const double width = sampled_angle_ / double(bin_count);
    const double low = one_minus_cos(i * width), high = one_minus_cos((i + 1) * width);
    const double h = low + v * (high - low);  // 1 − cosθ
    const auto r = static_cast<float>(std::sqrt(h * (2 - h)));
    const float phi = 2 * pi * u.y;
    return Frame::from_normal(axis_).to_world(
        {r * std::cos(phi), r * std::sin(phi), static_cast<float>(1 - h)});
}

double Shaping::pdf(Vec3f direction) const {
    const float theta = angle_to(direction);
    if (density_.empty() || !(theta <= sampled_angle_)) return 0;
    const auto i = static_cast<int>(theta / sampled_angle_ * bin_count);
    return density_[std::min(i, bin_count - 1)];
}

}  // namespace usdmlt
