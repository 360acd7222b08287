#include "film/film.hpp"

#include <bit>

namespace usdmlt {
namespace {

double luminance_of(const int64_t* rgb) {
    return luminance(double(rgb[0]), double(rgb[1]), double(rgb[2]));
}

}  // namespace

Film::Film(int width, int height, double scale, double sample_weight, bool with_splats,
           bool with_error, int layers)
    : width_(width),
      height_(height),
      layers_(layers),
      scale_(scale),
      sample_weight_(sample_weight) {
    const size_t pixels = size_t(width) * height;
    samples_.assign(pixels * 5, 0);
    if (with_splats) splats_.assign(pixels * 3, 0);
    if (with_error) squares_.assign(pixels, 0);
    if (with_error && with_splats) splat_squares_.assign(pixels, 0);
    layer_sums_.assign(pixels * size_t(layers) * 3, 0);
}

// Each part is rounded for itself, and what is then too much or missing is the largest one's.
void Film::add_parts(size_t pixel, const double all[3], double scale, const LayerSums& parts) {
    const auto magnitude = [](const LayerSums::Part& part) {
        return std::fabs(part.value[0]) + std::fabs(part.value[1]) + std::fabs(part.value[2]);
    };
    const LayerSums::Part* largest = nullptr;
    for (const LayerSums::Part& part : parts.parts)
        if (!largest || magnitude(part) > magnitude(*largest)) largest = &part;
    if (!largest) return;
    int64_t rest[3];
    for (int c = 0; c < 3; ++c) {
        if (!(std::fabs(all[c] * scale) < limit)) return;  // the picture lacks it too
        rest[c] = std::llrint(all[c] * scale);
    }
    const auto add_to_layers = [&](LayerMask mask, const int64_t value[3]) {
        for (; mask != 0; mask &= mask - 1) {
            int64_t* sum = &layer_sums_[layer_index(pixel, std::countr_zero(mask))];
            for (int c = 0; c < 3; ++c)
                if (value[c] != 0)
                    std::atomic_ref<int64_t>(sum[c]).fetch_add(value[c], std::memory_order_relaxed);
        }
    };
    for (const LayerSums::Part& part : parts.parts) {
        if (&part == largest) continue;
        int64_t value[3];
        for (int c = 0; c < 3; ++c) {
            value[c] = std::llrint(std::clamp(part.value[c] * scale, -limit, limit));
            rest[c] -= value[c];
        }
        add_to_layers(part.mask, value);
    }
    add_to_layers(largest->mask, rest);
}

void Film::add_splats(UnitSplats& unit) {
    unit.take([&](int x, int y, const UnitSplats::Sum& sum) {
        const size_t i = index(x, y);
        for (size_t c = 0; c < 3; ++c) add(splats_[i * 3 + c], sum[c]);
        if (has_error()) add(splat_squares_[i], rounded_square(i, luminance_of(sum.data())));
    });
}

void Film::develop_layer(int layer, float* rgb, double splats_per_pixel, double exposure) const {
    const size_t pixels = size_t(width_) * height_;
    for (size_t i = 0; i < pixels; ++i)
        for (int c = 0; c < 3; ++c) {
            double all = double(samples_[i * 5 + size_t(c)]);
            if (has_splats()) all += double(splats_[i * 3 + size_t(c)]);
            const auto sum = double(layer_sums_[layer_index(i, layer) + size_t(c)]);
            const double value = all != 0 ? sum / all * mean(i, c, splats_per_pixel) : 0;
            rgb[i * 3 + size_t(c)] = static_cast<float>(value * exposure);
        }
}

std::vector<Film::Plane> Film::planes() {
    const auto w = size_t(width_), h = size_t(height_), n = size_t(layers_);
    std::vector<Plane> planes{{"samples", &samples_, {h, w, 5}}};
    if (!splats_.empty()) planes.push_back({"splats", &splats_, {h, w, 3}});
    if (!squares_.empty()) planes.push_back({"squares", &squares_, {h, w}});
    if (!splat_squares_.empty()) planes.push_back({"splat_squares", &splat_squares_, {h, w}});
    if (!layer_sums_.empty()) planes.push_back({"layers", &layer_sums_, {h, w, n, 3}});
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
    for (size_t i = 0; i < pixels; ++i) {
        for (int c = 0; c < 3; ++c)
            rgba[i * 4 + size_t(c)] = static_cast<float>(mean(i, c, splats_per_pixel) * exposure);
        const int64_t* s = &samples_[i * 5];
        rgba[i * 4 + 3] =
            s[4] > 0 ? static_cast<float>(double(s[3]) / (double(s[4]) * alpha_unit)) : 0;
    }
}

void Film::develop_error(float* error, double splats_per_pixel, int64_t units,
                         double exposure) const {
    const size_t pixels = size_t(width_) * height_;
    for (size_t i = 0; i < pixels; ++i) {
        double variance = 0;
        const int64_t* s = &samples_[i * 5];
        // Of the sum of n independent numbers: n/(n − 1) (Σ x² − (Σ x)²/n).
        if (const auto n = double(s[4]); n > 1 && has_error())
            variance += squared_deviations(squares_[i], luminance_of(s) / sample_weight_, n) /
                        (n * (n - 1));
        if (const auto n = double(units); n > 1 && !splat_squares_.empty() && splats_per_pixel > 0)
            variance += squared_deviations(splat_squares_[i], luminance_of(&splats_[i * 3]), n) *
                        n / (n - 1) / (splats_per_pixel * splats_per_pixel);
        error[i] = static_cast<float>(std::sqrt(variance) / scale_ * exposure);
    }
}

}  // namespace usdmlt
