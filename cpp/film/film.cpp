#include "film/film.hpp"

#include <bit>

namespace usdmlt {

Film::Film(int width, int height, double scale, bool with_splats, bool with_error, int layers)
    : width_(width), height_(height), layers_(layers), scale_(scale) {
    const size_t pixels = size_t(width) * height;
    samples_.assign(pixels * 5, 0);
    if (with_splats) splats_.assign(pixels * 3, 0);
    if (with_error) squares_.assign(pixels, 0);
    if (with_error && with_splats) batch_sums_.assign(pixels * batches, 0);
    layer_samples_.assign(pixels * size_t(layers) * 3, 0);
    if (with_splats) layer_splats_.assign(pixels * size_t(layers) * 3, 0);
}

// Each part is rounded for itself, and what is then too much or missing is the largest one's.
void Film::add_parts(std::vector<int64_t>& sums, size_t pixel, const double all[3],
                     const LayerSums& parts) {
    const auto magnitude = [](const LayerSums::Part& part) {
        return std::fabs(part.value[0]) + std::fabs(part.value[1]) + std::fabs(part.value[2]);
    };
    const LayerSums::Part* largest = nullptr;
    for (const LayerSums::Part& part : parts.parts)
        if (!largest || magnitude(part) > magnitude(*largest)) largest = &part;
    if (!largest) return;
    int64_t rest[3];
    for (int c = 0; c < 3; ++c) {
        if (!(std::fabs(all[c] * scale_) < limit)) return;  // the picture lacks it too
        rest[c] = std::llrint(all[c] * scale_);
    }
    const auto add_to_layers = [&](LayerMask mask, const int64_t value[3]) {
        for (; mask != 0; mask &= mask - 1) {
            int64_t* sum = &sums[layer_index(pixel, std::countr_zero(mask))];
            for (int c = 0; c < 3; ++c)
                if (value[c] != 0)
                    std::atomic_ref<int64_t>(sum[c]).fetch_add(value[c], std::memory_order_relaxed);
        }
    };
    for (const LayerSums::Part& part : parts.parts) {
        if (&part == largest) continue;
        int64_t value[3];
        for (int c = 0; c < 3; ++c) {
            value[c] = std::llrint(std::clamp(part.value[c] * scale_, -limit, limit));
            rest[c] -= value[c];
        }
        add_to_layers(part.mask, value);
    }
    add_to_layers(largest->mask, rest);
}

void Film::develop_layer(int layer, float* rgb, double splats_per_pixel, double exposure) const {
    const size_t pixels = size_t(width_) * height_;
    const double splat_scale = splats_per_pixel > 0 ? 1 / (splats_per_pixel * scale_) : 0;
    for (size_t i = 0; i < pixels; ++i) {
        const int64_t n = sample_count(i);
        const double sample_scale = n > 0 ? 1 / (double(n) * scale_) : 0;
        for (int c = 0; c < 3; ++c)
            rgb[i * 3 + size_t(c)] =
                static_cast<float>((double(sample_sum(i, c, layer)) * sample_scale +
                                    double(splat_sum(i, c, layer)) * splat_scale) *
                                   exposure);
    }
}

std::vector<Film::Plane> Film::planes() {
    const auto w = size_t(width_), h = size_t(height_), n = size_t(layers_);
    std::vector<Plane> planes{{"samples", &samples_, {h, w, 5}}};
    if (!splats_.empty()) planes.push_back({"splats", &splats_, {h, w, 3}});
    if (!squares_.empty()) planes.push_back({"squares", &squares_, {h, w}});
    if (!batch_sums_.empty()) planes.push_back({"batches", &batch_sums_, {batches, h, w}});
    if (!layer_samples_.empty()) planes.push_back({"layer_samples", &layer_samples_, {h, w, n, 3}});
    if (!layer_splats_.empty()) planes.push_back({"layer_splats", &layer_splats_, {h, w, n, 3}});
    return planes;
}

void Film::add_sums(const Plane& plane, const int64_t* sums) {
    for (int64_t& sum : *plane.sums) {
        const int64_t other = *sums++;
        if (std::fabs(double(sum) + double(other)) >= limit)
            ++overflows_;
        else
            sum += other;
    }
}

void Film::clear() {
    for (const Plane& plane : planes()) std::ranges::fill(*plane.sums, 0);
    overflows_ = 0;
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
            const auto sum = [&](int b) {
                return double(batch_sums_[batch_index(i, b)]) / splats_per_pixel;
            };
            double total = 0, squares = 0;
            for (int b = 0; b < batches; ++b) total += sum(b);
            for (int b = 0; b < batches; ++b)
                if (share[b] > 0) {
                    const double d = sum(b) / share[b] - total;
                    squares += share[b] * d * d;
                }
            variance += squares / (used - 1);
        }
        error[i] = static_cast<float>(std::sqrt(variance) / scale_ * exposure);
    }
}

}  // namespace usdmlt
