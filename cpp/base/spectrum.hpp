// Radiometric values: four float lanes; linear RGB of the rendering space uses three, the fourth is
// reserved and stays zero.
#pragma once

#include <algorithm>
#include <cmath>

namespace usdmlt {

struct Spectrum {
    // A vector type is passed in one register; an array of four takes two.
    using Lanes [[gnu::vector_size(4 * sizeof(float))]] = float;
    Lanes c = {0, 0, 0, 0};

    Spectrum() = default;
    explicit Spectrum(Lanes lanes) : c(lanes) {}
    constexpr explicit Spectrum(float v) : c{v, v, v, 0} {}
    constexpr Spectrum(float r, float g, float b) : c{r, g, b, 0} {}

    float operator[](int i) const { return c[i]; }
    float& operator[](int i) { return reinterpret_cast<float*>(&c)[i]; }

    Spectrum& operator+=(const Spectrum& o) { return *this = Spectrum(c + o.c); }
    Spectrum& operator*=(const Spectrum& o) { return *this = Spectrum(c * o.c); }
    Spectrum& operator*=(float s) { return *this = Spectrum(c * s); }
};

inline Spectrum operator+(const Spectrum& a, const Spectrum& b) { return Spectrum(a.c + b.c); }
inline Spectrum operator-(const Spectrum& a, const Spectrum& b) { return Spectrum(a.c - b.c); }
inline Spectrum operator*(const Spectrum& a, const Spectrum& b) { return Spectrum(a.c * b.c); }
inline Spectrum operator*(const Spectrum& a, float s) { return Spectrum(a.c * s); }
inline Spectrum operator*(float s, const Spectrum& a) { return a * s; }
inline Spectrum operator/(const Spectrum& a, float s) { return a * (1 / s); }
inline Spectrum operator/(const Spectrum& a, const Spectrum& b) {
    return Spectrum(a[0] / b[0], a[1] / b[1], a[2] / b[2]);  // 0/0 in the last
}

inline float max_component(const Spectrum& s) { return std::max({s[0], s[1], s[2]}); }
inline float mean(const Spectrum& s) { return (s[0] + s[1] + s[2]) * (1.0f / 3); }
// Rec.709 luminance weights: an importance, not a colour-managed quantity.
template <typename Float>
Float luminance(Float r, Float g, Float b) {
    return Float(0.2126) * r + Float(0.7152) * g + Float(0.0722) * b;
}
inline float luminance(const Spectrum& s) { return luminance(s[0], s[1], s[2]); }
inline bool is_black(const Spectrum& s) { return s[0] == 0 && s[1] == 0 && s[2] == 0; }
inline bool is_finite(const Spectrum& s) {
    return std::isfinite(s[0]) && std::isfinite(s[1]) && std::isfinite(s[2]);
}

}  // namespace usdmlt
