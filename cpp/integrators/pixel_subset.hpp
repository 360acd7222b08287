// The camera samples of a unit: one in each pixel of a lattice that is spread over the image, so
// that a number of units together have one in every pixel; or some in every pixel of small images.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "film/pixel_filter.hpp"

namespace usdmlt {

// Pixels of a margin count as well: with them, raster points are uniform over all from which the
// filter lets light into the image.
class PixelSubset {
public:
    struct Place {
        int x, y;  // negative, or beyond the image, in the margin
        bool in_image;
        uint32_t pixel;  // counted with the margin
        uint32_t pass;   // of all the pixel's samples
    };

    // `width`, `height`: of the film, whose pixels are squares of `reduction` camera pixels.
    PixelSubset(int width, int height, const PixelFilter& filter, int reduction)
        : width_(width),
          height_(height),
          margin_(static_cast<int>(std::ceil(2 * filter.reach() / float(reduction)))) {}

    // About so many samples per unit.
    void set_samples(double samples) {
        const double pixels = double(width_) * height_;
        units_per_pass_ = std::max(std::llround(pixels / samples), 1ll);
        passes_per_unit_ = std::max(std::llround(samples / pixels), 1ll);
        // Near the golden ratio, a lattice has no long gaps.
        stride_ = std::llround(double(units_per_pass_) * 0.6180339887);
    }
    double samples_per_pixel() const { return double(passes_per_unit_) / double(units_per_pass_); }
    int64_t units_per_pass() const { return units_per_pass_; }

    // f(place) for every sample of a unit. `offset` turns the order of a pass's units.
    template <typename F>
    void for_each(int64_t unit, uint64_t offset, F&& f) const {
        const int64_t first = unit / units_per_pass_ * passes_per_unit_;
        const auto part =
            static_cast<int64_t>((uint64_t(unit) + offset) % uint64_t(units_per_pass_));
        const int64_t across = width_ + 2 * margin_, down = height_ + 2 * margin_;
        for (int64_t pass = first; pass < first + passes_per_unit_; ++pass)
            for (int64_t y = 0; y < down; ++y) {
                const int64_t rest = (part - y * stride_) % units_per_pass_;
                for (int64_t x = rest < 0 ? rest + units_per_pass_ : rest; x < across;
                     x += units_per_pass_)
                    f(place(static_cast<uint32_t>(y * across + x), static_cast<uint32_t>(pass)));
            }
    }
    Place place(uint32_t pixel, uint32_t pass) const {
        const auto across = static_cast<uint32_t>(width_ + 2 * margin_);
        const int x = static_cast<int>(pixel % across) - margin_;
        const int y = static_cast<int>(pixel / across) - margin_;
        return {x, y, x >= 0 && y >= 0 && x < width_ && y < height_, pixel, pass};
    }

private:
    int width_, height_, margin_;
    int64_t units_per_pass_ = 1, passes_per_unit_ = 1, stride_ = 0;
};

}  // namespace usdmlt
