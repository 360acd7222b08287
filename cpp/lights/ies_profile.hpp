// An IES photometric profile: a table of factors over the angle θ from the light's −z axis and the
// azimuth φ, bilinear in between and 0 outside.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/vec.hpp"

namespace usdmlt {

struct IesProfile {
    std::vector<float> theta;   // radians, ascending
    std::vector<float> phi;     // radians, ascending, from 0 to 2π; or one value for all azimuths
    std::vector<float> values;  // of each phi those of all thetas

    bool empty() const { return values.empty(); }

    // `azimuth`: any; it is periodic.
    float evaluate(float angle, float azimuth) const {
        if (!(angle >= theta.front() && angle <= theta.back())) return 0;
        const Place t = place(theta, angle);
        if (phi.size() == 1) return along(0, t);
        const float turned = azimuth < 0 ? azimuth + 2 * pi : azimuth;
        const Place p = place(phi, turned);
        return along(p.index, t) * (1 - p.fraction) + along(p.index + 1, t) * p.fraction;
    }

private:
    struct Place {
        size_t index;
        float fraction;  // towards index + 1
    };

    static Place place(const std::vector<float>& knots, float x) {
        if (knots.size() == 1) return {0, 0};
        const auto above = std::upper_bound(knots.begin() + 1, knots.end() - 1, x);
        const auto i = static_cast<size_t>(above - knots.begin()) - 1;
        const float width = knots[i + 1] - knots[i];
        return {i, width > 0 ? std::clamp((x - knots[i]) / width, 0.0f, 1.0f) : 0};
    }

    float along(size_t p, Place t) const {
        const float* row = values.data() + p * theta.size() + t.index;
        return t.fraction > 0 ? row[0] * (1 - t.fraction) + row[1] * t.fraction : row[0];
    }
};

}  // namespace usdmlt
