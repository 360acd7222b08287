#include "film/film.hpp"

namespace usdmlt {

Film::Film(int width, int height, double scale, bool with_splats)
    : width_(width), height_(height), scale_(scale) {
    samples_.assign(size_t(width) * height * 5, 0);
    if (with_splats) splats_.assign(size_t(width) * height * 3, 0);
}

int64_t Film::sample_count() const {
    int64_t n = 0;
    for (size_t i = 4; i < samples_.size(); i += 5) n += samples_[i];
    return n;
}

void Film::develop(float* rgba, double exposure) const {
    const size_t pixels = size_t(width_) * height_;
    const int64_t total = sample_count();
    const double splat_scale = total > 0 ? double(pixels) / double(total) / scale_ : 0;
    for (size_t i = 0; i < pixels; ++i) {
        const int64_t* s = &samples_[i * 5];
        const double sample_scale = s[4] > 0 ? 1 / (double(s[4]) * scale_) : 0;
        for (int c = 0; c < 3; ++c) {
            double value = double(s[c]) * sample_scale;
            if (!splats_.empty()) value += double(splats_[i * 3 + c]) * splat_scale;
            rgba[i * 4 + c] = static_cast<float>(value * exposure);
        }
        rgba[i * 4 + 3] = static_cast<float>(double(s[3]) * sample_scale);
    }
}

}  // namespace usdmlt
