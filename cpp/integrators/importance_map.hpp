// Two-stage Metropolis light transport (Veach 1997, §11.3.5): a weight w(raster) of the target, the
// inverse of a coarse picture, so that dark regions get as many samples as bright ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "mutations/context.hpp"

namespace usdmlt {

// Brightness by cell of a grid over the raster domain.
class CoarsePicture {
public:
    explicit CoarsePicture(const RasterDomain& domain)
        : lower_(domain.lower),
          scale_{cells / (domain.upper.x - domain.lower.x),
                 cells / (domain.upper.y - domain.lower.y)},
          sums_(size_t(cells) * cells) {}

    static constexpr int cells = 32;  // across and down
    static constexpr int count = cells * cells;
    size_t cell(Vec2f raster) const {
        const auto index = [](float x) { return std::clamp(static_cast<int>(x), 0, cells - 1); };
        return size_t(index((raster.y - lower_.y) * scale_.y)) * cells +
               size_t(index((raster.x - lower_.x) * scale_.x));
    }
    void add(Vec2f raster, double value) { sums_[cell(raster)] += value; }
    void scale(double factor) {
        for (double& s : sums_) s *= factor;
    }
    const std::vector<double>& sums() const { return sums_; }
    double mean() const { return std::accumulate(sums_.begin(), sums_.end(), 0.0) / count; }

private:
    Vec2f lower_, scale_;
    std::vector<double> sums_;
};

class ImportanceMap {
public:
    // Everywhere 1.
    ImportanceMap() = default;

    // Errors are judged by var / (R² + ε), R relative to the mean: w = 1 / √(R² + ε) would be best
    // for independent samples; w = (R² + ε)^−¼ was measured to be better for chains, whose steps
    // are rejected where w varies much. R is smoothed, as it is noisy itself; w is bounded, so that
    // no pixel is lost.
    explicit ImportanceMap(const CoarsePicture& picture) : picture_(picture) {
        constexpr int n = CoarsePicture::cells;
        const std::vector<double>& sums = picture.sums();
        const double mean = picture.mean();
        if (!(mean > 0)) return;
        weight_.resize(sums.size());
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x) {
                double sum = 0, total = 0;
                for (int dy = -1; dy <= 1; ++dy)
                    for (int dx = -1; dx <= 1; ++dx) {
                        const int i = std::clamp(x + dx, 0, n - 1),
                                  j = std::clamp(y + dy, 0, n - 1);
                        const double g = (dx == 0 ? 2 : 1) * (dy == 0 ? 2 : 1);
                        sum += g * sums[size_t(j) * n + size_t(i)];
                        total += g;
                    }
                const double r = sum / (total * mean);
                weight_[size_t(y) * n + size_t(x)] = 1 / std::sqrt(std::sqrt(r * r + 0.01));
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
