// What a pilot knows of the picture: brightness by cell of a grid over the raster domain, smoothed
// along surfaces so that the few paths of a pilot tell about each cell, but not across the edges
// that the camera sees, where brightness jumps.
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "mutations/context.hpp"

namespace usdmlt {

// What the camera sees first in a cell.
struct SeenSurface {
    Vec3f position, normal;  // normal: unit, towards the camera; 0 where nothing is seen
    float albedo = 1;        // roughly: brightness goes with it, as textures do
};

class CoarsePicture {
public:
    // As fine as pixels, if these are not more than `most_cells`.
    CoarsePicture(const RasterDomain& domain, double most_cells);

    size_t count() const { return sums_.size(); }
    size_t cell(Vec2f raster) const {
        const auto index = [](float x, int n) { return std::clamp(static_cast<int>(x), 0, n - 1); };
        return size_t(index((raster.y - lower_.y) * scale_.y, down_)) * size_t(across_) +
               size_t(index((raster.x - lower_.x) * scale_.x, across_));
    }
    Vec2f center(size_t cell) const {
        return lower_ + Vec2f{(float(cell % size_t(across_)) + 0.5f) / scale_.x,
                              (float(cell / size_t(across_)) + 0.5f) / scale_.y};
    }

    void add(Vec2f raster, double value) { sums_[cell(raster)] += value; }
    void scale(double factor) {
        for (double& s : sums_) s *= factor;
    }
    // Every cell gets the mean of those around it that show the same surface, over about so many
    // cells (à trous: Dammertz et al. 2010, "Edge-avoiding à-trous wavelet transform for fast
    // global illumination filtering"), of brightness over albedo. `seen`: of every cell.
    void smooth(const std::vector<SeenSurface>& seen, double cells);

    const std::vector<double>& sums() const { return sums_; }
    double mean() const {
        return std::accumulate(sums_.begin(), sums_.end(), 0.0) / double(sums_.size());
    }

private:
    int across_, down_;
    Vec2f lower_, scale_;
    std::vector<double> sums_;
};

// A camera ray through the middle of every cell.
std::vector<SeenSurface> seen_surfaces(const Scene& scene, const CoarsePicture& picture,
                                       RayCounters& rays);

}  // namespace usdmlt
