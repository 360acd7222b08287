// The film: sums of 64-bit fixed-point integers. Integer addition is associative, so the picture
// does not depend on which thread added what, or in which order.
//
// Two kinds of sums live here, normalised differently when the image is developed:
//   samples  values of camera samples, by the number of samples of their own pixel;
//   splats   contributions of paths anywhere, by their number per pixel of the whole image.
// Beside them, for the error of the luminance: squares of samples, and of what each unit splats in
// a pixel; and layers, of some of the paths each. A layer has one sum for both kinds, for which
// samples are weighted so that their number and that of splats are the same in the long run.
//
// A deposit is rounded once, and its parts so that they make it up exactly: layers that share all
// paths among them sum to the picture, integer for integer.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/rng.hpp"
#include "base/spectrum.hpp"
#include "film/layer_sums.hpp"
#include "film/unit_splats.hpp"

namespace usdmlt {

class Film {
public:
    // `scale` turns radiance into fixed point; it is part of the plan and independent of the
    // number of samples, as is `sample_weight`: splats per pixel to a sample of each pixel.
    Film(int width, int height, double scale, double sample_weight, bool with_splats,
         bool with_error, int layers = 0);

    int width() const { return width_; }
    int height() const { return height_; }
    double scale() const { return scale_; }
    double sample_weight() const { return sample_weight_; }
    bool has_splats() const { return !splats_.empty(); }
    bool has_error() const { return !squares_.empty(); }
    int layers() const { return layers_; }

    // Adds one sample of a pixel; alpha in the fourth lane of doubles. `parts`: of the value, where
    // there are layers.
    void add_sample(int x, int y, const double value[4], const LayerSums* parts = nullptr) {
        const size_t i = index(x, y);
        int64_t* p = &samples_[i * 5];
        for (int c = 0; c < 3; ++c) add(p[c], value[c] * scale_ * sample_weight_);
        if (parts) add_parts(i, value, scale_ * sample_weight_, *parts);
        add(p[3], value[3] * alpha_unit);
        std::atomic_ref<int64_t>(p[4]).fetch_add(1, std::memory_order_relaxed);
        if (has_error()) {
            const double v = luminance(value[0], value[1], value[2]);
            add(squares_[i], rounded_square(i, v * scale_));
        }
    }
    // Of a unit, to be added at its end.
    void add_splat(int x, int y, const Spectrum& value, UnitSplats& unit,
                   const LayerSums* parts = nullptr) {
        UnitSplats::Sum& sum = unit.at(x, y);
        for (int c = 0; c < 3; ++c) {
            int64_t& total = sum[size_t(c)];
            const double fixed = double(value[c]) * scale_;
            if (std::fabs(double(total) + fixed) < limit)
                total += std::llrint(fixed);
            else
                overflows_.fetch_add(1, std::memory_order_relaxed);
        }
        if (parts) {
            const double all[3] = {value[0], value[1], value[2]};
            add_parts(index(x, y), all, scale_, *parts);
        }
    }
    // Adds what a unit has splatted, and its squares.
    void add_splats(UnitSplats& unit);

    // RGBA in row-major order, top row first: samples / their count + splats / splats_per_pixel.
    // Not to be called while units are running.
    void develop(float* rgba, double splats_per_pixel, double exposure) const;

    // RGB of one layer. While some pixels have a sample more than others, the number that its
    // deposits are divided by is that of the picture's own, which may have another share of
    // samples.
    void develop_layer(int layer, float* rgb, double splats_per_pixel, double exposure) const;

    int64_t sample_count(size_t pixel) const { return samples_[pixel * 5 + 4]; }

    // Standard error of the picture's luminance by pixel: from the spread of the samples, taken as
    // independent, and of what so many units have splatted.
    void develop_error(float* error, double splats_per_pixel, int64_t units, double exposure) const;

    // All sums, to be stored and added again: by name, and as arrays of these dimensions. Not to be
    // touched while units are running.
    struct Plane {
        std::string name;
        std::vector<int64_t>* sums;
        std::vector<size_t> shape;
    };
    std::vector<Plane> planes();
    // Adds sums of the same size to one of planes(), and what another film counted to overflows().
    void add_sums(const Plane& plane, const int64_t* sums);
    void add_overflows(uint64_t count) { overflows_ += count; }
    void clear();

    // Deposits that did not fit; the picture is then wrong and the user is told.
    uint64_t overflows() const { return overflows_.load(); }
    int64_t sample_count() const;

private:
    size_t index(int x, int y) const { return size_t(y) * width_ + x; }
    size_t layer_index(size_t pixel, int layer) const {
        return (pixel * size_t(layers_) + size_t(layer)) * 3;
    }
    void add_parts(size_t pixel, const double all[3], double scale, const LayerSums& parts);
    // Of a picture's pixel.
    double mean(size_t pixel, int channel, double splats_per_pixel) const {
        const int64_t* s = &samples_[pixel * 5];
        double value = s[4] > 0 ? double(s[channel]) / (double(s[4]) * sample_weight_) : 0;
        if (splats_per_pixel > 0 && has_splats())
            value += double(splats_[pixel * 3 + size_t(channel)]) / splats_per_pixel;
        return value / scale_;
    }
    void add(int64_t& sum, double fixed) {
        if (!(std::fabs(fixed) < limit)) {
            overflows_.fetch_add(1, std::memory_order_relaxed);
            return;
        }
        add(sum, int64_t(std::llrint(fixed)));
    }
    void add(int64_t& sum, int64_t v) {
        if (v == 0) return;
        const int64_t old = std::atomic_ref<int64_t>(sum).fetch_add(v, std::memory_order_relaxed);
        if (std::fabs(double(old) + double(v)) >= limit)
            overflows_.fetch_add(1, std::memory_order_relaxed);
    }

    static constexpr double limit = 0x1p62;

    // Of a value in fixed point, in units of squares. It is rounded up or down by a hash: as values
    // differ, what small squares lose is right on average.
    static double rounded_square(size_t pixel, double value) {
        const uint64_t hash = hash_key(pixel, std::bit_cast<uint64_t>(value));
        const double dither = double(hash >> 11) * 0x1p-53;
        return std::min(std::floor(value * value * square_unit + dither), 0x1p60);
    }
    // Σ x² − (Σ x)²/n of n values, the squares from there. Where there is light it is one unit at
    // least: the squares may all have been rounded to none.
    static double squared_deviations(int64_t squares, double sum, double n) {
        if (sum == 0) return 0;
        return std::max(double(squares) / square_unit - sum * sum / n, 1 / square_unit);
    }

    // Alpha has no unit of light: its fixed point is the same in dark scenes and in bright ones.
    static constexpr double alpha_unit = 0x1p26;
    // Squares are kept coarser, so that those of bright samples fit.
    static constexpr double square_unit = 0x1p-32;

    int width_, height_, layers_;
    double scale_, sample_weight_;
    std::vector<int64_t> samples_;        // r, g, b, all weighted, alpha, count per pixel
    std::vector<int64_t> splats_;         // r, g, b per pixel
    std::vector<int64_t> squares_;        // of the samples' luminance, per pixel
    std::vector<int64_t> splat_squares_;  // of the luminance of each unit's splats, per pixel
    std::vector<int64_t> layer_sums_;     // r, g, b per pixel and layer
    std::atomic<uint64_t> overflows_{0};
};

}  // namespace usdmlt
