// Radiometric values: four float lanes; linear RGB of the rendering space uses three, the fourth is
// reserved and stays zero.
#pragma once

#include <algorithm>
#include <cmath>

namespace usdmlt {

struct alignas(16) Spectrum {
    float c[4] = {0, 0, 0, 0};

    Spectrum() = default;
    constexpr explicit Spectrum(float v) : c{v, v, v, 0} {}
    constexpr Spectrum(float r, float g, float b) : c{r, g, b, 0} {}

    float operator[](int i) const { return c[i]; }
    float& operator[](int i) { return c[i]; }

    Spectrum& operator+=(const Spectrum& o) {
        for (int i = 0; i < 4; ++i) c[i] += o.c[i];
        return *this;
    }
    Spectrum& operator*=(const Spectrum& o) {
        for (int i = 0; i < 4; ++i) c[i] *= o.c[i];
        return *this;
    }
    Spectrum& operator*=(float s) {
        for (int i = 0; i < 4; ++i) c[i] *= s;
        return *this;
    }
};

inline Spectrum operator+(Spectrum a, const Spectrum& b) { return a += b; }
inline Spectrum operator-(Spectrum a, const Spectrum& b) {
    for (int i = 0; i < 4; ++i) a.c[i] -= b.c[i];
    return a;
}
inline Spectrum operator*(Spectrum a, const Spectrum& b) { return a *= b; }
inline Spectrum operator*(Spectrum a, float s) { return a *= s; }
inline Spectrum operator*(float s, Spectrum a) { return a *= s; }
inline Spectrum operator/(Spectrum a, float s) { return a *= 1 / s; }
inline Spectrum operator/(Spectrum a, const Spectrum& b) {
    for (int i = 0; i < 3; ++i) a.c[i] /= b.c[i];
    return a;
}

inline float max_component(const Spectrum& s) { return std::max({s.c[0], s.c[1], s.c[2]}); }
inline float mean(const Spectrum& s) { return (s.c[0] + s.c[1] + s.c[2]) * (1.0f / 3); }
// Rec.709 luminance weights: an importance, not a colour-managed quantity.
template <typename Float>
Float luminance(Float r, Float g, Float b) {
    return Float(0.2126) * r + Float(0.7152) * g + Float(0.0722) * b;
}
inline float luminance(const Spectrum& s) { return luminance(s.c[0], s.c[1], s.c[2]); }
inline bool is_black(const Spectrum& s) { return s.c[0] == 0 && s.c[1] == 0 && s.c[2] == 0; }
inline bool is_finite(const Spectrum& s) {
    return std::isfinite(s.c[0]) && std::isfinite(s.c[1]) && std::isfinite(s.c[2]);
}

}  // namespace usdmlt
