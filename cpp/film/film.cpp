#include "film/film.hpp"

namespace usdmlt {

Film::Film(int width, int height, double scale, bool with_splats, bool with_error)
    : width_(width), height_(height), scale_(scale) {
    const size_t pixels = size_t(width) * height;
    samples_.assign(pixels * 5, 0);
    if (with_splats) splats_.assign(pixels * 3, 0);
    if (with_error) squares_.assign(pixels, 0);
    if (with_error && with_splats) batch_sums_.assign(pixels * batches, 0);
}

int64_t Film::sample_count() const {
    int64_t n = 0;
    for (size_t i = 4; i < samples_.size(); i += 5) n += samples_[i];
    return n;
}

void Film::develop(float* rgba, double splats_per_pixel, double exposure) const {
    const size_t pixels = size_t(width_) * height_;
    const double splat_scale = splats_per_pixel > 0 ? 1 / (splats_per_pixel * scale_) : 0;
    for (size_t i = 0; i < pixels; ++i) {
        const int64_t* s = &samples_[i * 5];
        const double sample_scale = s[4] > 0 ? 1 / (double(s[4]) * scale_) : 0;
        for (int c = 0; c < 3; ++c) {
            double value = double(s[c]) * sample_scale;
            if (!splats_.empty()) value += double(splats_[i * 3 + c]) * splat_scale;
            rgba[i * 4 + c] = static_cast<float>(value * exposure);
        }
        rgba[i * 4 + 3] =
            s[4] > 0 ? static_cast<float>(double(s[3]) / (double(s[4]) * alpha_unit)) : 0;
    }
}

void Film::develop_error(float* error, double splats_per_pixel, const double share[batches],
                         double exposure) const {
    const size_t pixels = size_t(width_) * height_;
    int used = 0;
    for (int b = 0; b < batches; ++b) used += share[b] > 0;
    for (size_t i = 0; i < pixels; ++i) {
        double variance = 0;
        const int64_t* s = &samples_[i * 5];
        if (const auto n = double(s[4]); n > 1 && has_error()) {
            const double mean =
                (0.2126 * double(s[0]) + 0.7152 * double(s[1]) + 0.0722 * double(s[2])) / n;
            const double square = double(squares_[i]) / square_unit / n;
            variance += std::max(square - mean * mean, 0.0) / (n - 1);
        }
        if (!batch_sums_.empty() && used > 1 && splats_per_pixel > 0) {
            // Batches of share q have variance σ²/q; Σ q (x_b − x̄)² is then (n − 1) σ² on average.
            const int64_t* sums = &batch_sums_[i * batches];
            double total = 0, squares = 0;
            for (int b = 0; b < batches; ++b) total += double(sums[b]) / splats_per_pixel;
            for (int b = 0; b < batches; ++b)
                if (share[b] > 0) {
                    const double d = double(sums[b]) / (splats_per_pixel * share[b]) - total;
                    squares += share[b] * d * d;
                }
            variance += squares / (used - 1);
        }
        error[i] = static_cast<float>(std::sqrt(variance) / scale_ * exposure);
    }
}

}  // namespace usdmlt
