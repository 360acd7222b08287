// The film: sums of 64-bit fixed-point integers. Integer addition is associative, so the picture
// does not depend on which thread added what, or in which order.
//
// Two kinds of sums live here, normalised differently when the image is developed:
//   samples  values of camera samples, by the number of samples of their own pixel;
//   splats   contributions of light subpaths anywhere, by the number of samples of the whole image.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/spectrum.hpp"

namespace usdmlt {

class Film {
public:
    // `scale` turns radiance into fixed point; it is part of the plan and independent of the
    // number of samples.
    Film(int width, int height, double scale, bool with_splats);

    int width() const { return width_; }
    int height() const { return height_; }
    double scale() const { return scale_; }
    bool has_splats() const { return !splats_.empty(); }

    // Adds the sum of `count` samples of a pixel; alpha in the fourth lane of doubles.
    void add_samples(int x, int y, const double sum[4], int64_t count) {
        int64_t* p = &samples_[index(x, y) * 5];
        for (int c = 0; c < 4; ++c) add(p[c], sum[c]);
        std::atomic_ref<int64_t>(p[4]).fetch_add(count, std::memory_order_relaxed);
    }
    void add_splat(int x, int y, const Spectrum& value) {
        int64_t* p = &splats_[index(x, y) * 3];
        for (int c = 0; c < 3; ++c) add(p[c], value[c]);
    }

    // RGBA in row-major order, top row first: samples / their count + splats · pixels / all
    // samples. Not to be called while units are running.
    void develop(float* rgba, double exposure) const;

    // Deposits that did not fit; the picture is then wrong and the user is told.
    uint64_t overflows() const { return overflows_.load(); }
    int64_t sample_count() const;

private:
    size_t index(int x, int y) const { return size_t(y) * width_ + x; }
    void add(int64_t& sum, double value) {
        const double fixed = value * scale_;
        constexpr double limit = 0x1p62;
        if (!(std::fabs(fixed) < limit)) {
            overflows_.fetch_add(1, std::memory_order_relaxed);
            return;
        }
        const int64_t v = std::llrint(fixed);
        if (v == 0) return;
        const int64_t old = std::atomic_ref<int64_t>(sum).fetch_add(v, std::memory_order_relaxed);
        if (std::fabs(static_cast<double>(old) + fixed) >= limit)
            overflows_.fetch_add(1, std::memory_order_relaxed);
    }

    int width_, height_;
    double scale_;
    std::vector<int64_t> samples_;  // r, g, b, alpha, count per pixel
    std::vector<int64_t> splats_;   // r, g, b per pixel
    std::atomic<uint64_t> overflows_{0};
};

}  // namespace usdmlt
