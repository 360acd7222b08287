// Two-stage Metropolis light transport (Veach 1997, §11.3.5): a weight w(raster) of the target, the
// inverse of a coarse picture, so that dark regions get as many samples as bright ones.
#pragma once

#include <algorithm>
#include <vector>

#include "mutations/context.hpp"

namespace usdmlt {

class ImportanceMap {
public:
    // Everywhere 1.
    ImportanceMap() = default;

    // From brightness per cell (columns × rows over the domain), in any unit. Cells darker than a
    // fraction of the mean count as that, so that w is bounded and no pixel is lost.
    ImportanceMap(const RasterDomain& domain, int columns, int rows, std::vector<double> brightness)
        : columns_(columns), rows_(rows), domain_lower_(domain.lower) {
        constexpr double darkest = 0.05, smooth = 0.1;
        scale_ = {float(columns) / (domain.upper.x - domain.lower.x),
                  float(rows) / (domain.upper.y - domain.lower.y)};
        double mean = 0;
        for (const double b : brightness) mean += b / double(brightness.size());
        if (!(mean > 0)) {
            columns_ = rows_ = 0;
            return;
        }
        for (double& b : brightness) b = 1 / (std::max(b / mean, darkest) + smooth);
        weight_ = std::move(brightness);
    }

    double weight(Vec2f raster) const {
        if (weight_.empty()) return 1;
        const int x = static_cast<int>((raster.x - domain_lower_.x) * scale_.x);
        const int y = static_cast<int>((raster.y - domain_lower_.y) * scale_.y);
        return weight_[size_t(std::clamp(y, 0, rows_ - 1)) * size_t(columns_) +
                       size_t(std::clamp(x, 0, columns_ - 1))];
    }
    bool active() const { return !weight_.empty(); }

private:
    int columns_ = 0, rows_ = 0;
    Vec2f domain_lower_, scale_;
    std::vector<double> weight_;
};

}  // namespace usdmlt
