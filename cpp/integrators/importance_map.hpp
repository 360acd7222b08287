// Two-stage Metropolis light transport (Veach 1997, §11.3.5): a weight w(raster) of the target, the
// inverse of a coarse picture, so that dark regions get as many samples as bright ones.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "integrators/coarse_picture.hpp"

namespace usdmlt {

class ImportanceMap {
public:
    // Everywhere 1.
    ImportanceMap() = default;

    // Errors are judged by var / (R² + ε), R relative to the mean, to which w = 1 / √(R² + ε) makes
    // all pixels alike. Both ends are bounded: no pixel is lost; and what is much brighter than the
    // mean, in which the picture's own mean lies, is not left to few samples of great weight.
    explicit ImportanceMap(const CoarsePicture& picture) : picture_(picture) {
        constexpr double brightest = 3;
        const double mean = picture.mean();
        if (!(mean > 0)) return;
        weight_.reserve(picture.count());
        for (const double sum : picture.sums()) {
            const double r = std::min(sum / mean, brightest);
            weight_.push_back(1 / std::sqrt(r * r + 0.01));
        }
    }

    double weight(Vec2f raster) const {
        return weight_.empty() ? 1 : weight_[picture_->cell(raster)];
    }

private:
    std::optional<CoarsePicture> picture_;
    std::vector<double> weight_;
};

}  // namespace usdmlt
