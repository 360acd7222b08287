// Products of any magnitude: contributions and densities of long paths leave the range of double.
#pragma once

#include <cmath>
#include <cstdint>

namespace usdmlt {

// mantissa · 2^exponent. The mantissa is brought back when it strays, so that factors of ordinary
// size cost a multiplication and a compare.
struct ScaledDouble {
    double mantissa = 0;
    int64_t exponent = 0;

    ScaledDouble() = default;
    ScaledDouble(double value) : mantissa(value) { normalize(); }

    ScaledDouble& operator*=(double factor) {
        mantissa *= factor;
        normalize();
        return *this;
    }
    ScaledDouble& operator*=(const ScaledDouble& other) {
        exponent += other.exponent;
        return *this *= other.mantissa;
    }
    ScaledDouble& operator+=(const ScaledDouble& other) {
        if (other.mantissa == 0) return *this;
        if (mantissa == 0) return *this = other;
        if (other.exponent == exponent) {
            mantissa += other.mantissa;
        } else if (other.exponent < exponent) {
            mantissa += scale(other.mantissa, other.exponent - exponent);
        } else {
            mantissa = scale(mantissa, exponent - other.exponent) + other.mantissa;
            exponent = other.exponent;
        }
        normalize();
        return *this;
    }
    bool is_positive() const { return mantissa > 0 && std::isfinite(mantissa); }
    // ±infinity or 0 where a double cannot hold it.
    double value() const { return exponent == 0 ? mantissa : scale(mantissa, exponent); }
    double log() const { return std::log(mantissa) + 0.6931471805599453 * double(exponent); }

private:
    static double scale(double m, int64_t e) {
        constexpr int64_t limit = 4000;
        return std::ldexp(m, static_cast<int>(e < -limit ? -limit : e > limit ? limit : e));
    }
    void normalize() {
        constexpr double large = 0x1p256, small = 0x1p-256;
        const double m = std::fabs(mantissa);
        if ((m < large && m > small) || m == 0 || !(m < 0x1p1023)) return;
        int e;
        mantissa = std::frexp(mantissa, &e);
        exponent += e;
    }
};

inline ScaledDouble operator*(ScaledDouble a, const ScaledDouble& b) { return a *= b; }
inline ScaledDouble operator*(ScaledDouble a, double b) { return a *= b; }
inline ScaledDouble operator+(ScaledDouble a, const ScaledDouble& b) { return a += b; }

// a / b as a double.
inline double ratio(const ScaledDouble& a, const ScaledDouble& b) {
    ScaledDouble r;
    r.mantissa = a.mantissa / b.mantissa;
    r.exponent = a.exponent - b.exponent;
    return r.value();
}

}  // namespace usdmlt
