// A density of directions about a middle, drawn out as a linear map has it: in the plane that
// touches the unit sphere at the middle, with ξ = L w,
//     p(w) = |det L| σ² / (π (|ξ|² + σ²)²).
#pragma once

#include <array>
#include <numbers>

#include "base/frame.hpp"
#include "base/rng.hpp"

namespace usdmlt {

struct Matrix2 {
    double xx = 0, xy = 0, yx = 0, yy = 0;

    Vec2f operator*(Vec2f v) const {
        return {float(xx * v.x + xy * v.y), float(yx * v.x + yy * v.y)};
    }
    double determinant() const { return xx * yy - xy * yx; }
    Vec2f solve(Vec2f v) const {
        const double d = determinant();
        return {float((yy * v.x - xy * v.y) / d), float((xx * v.y - yx * v.x) / d)};
    }
};

// Of a point of the plane that touches the unit sphere at frame.z.
inline Vec3f direction_at(const Frame& frame, Vec2f w) {
    return normalize(frame.z + frame.x * w.x + frame.y * w.y);
}

struct AimedDirection {
    static constexpr double sigma = 0.15;

    bool found = false;
    Frame frame;      // z: the middle
    Matrix2 stretch;  // L, upper triangular

    Vec3f sample(Vec2f u) const {
        const double r = sigma * std::sqrt(u.x / (1 - double(u.x)));
        const double phi = 2 * std::numbers::pi * u.y;
        return direction_at(frame,
                            stretch.solve({float(r * std::cos(phi)), float(r * std::sin(phi))}));
    }
    // In solid angle.
    double pdf(Vec3f direction) const {
        const double z = dot(direction, frame.z);
        if (!found || !(z > 0)) return 0;
        const double x = dot(direction, frame.x) / z, y = dot(direction, frame.y) / z;
        const double r2 = sqr(stretch.xx * x + stretch.xy * y) + sqr(stretch.yy * y);
        return stretch.determinant() * sqr(sigma) /
               (std::numbers::pi * sqr(r2 + sqr(sigma)) * z * z * z);
    }
};

// The last values of a function, by a hash of what it was asked.
template <typename Value>
class Memo {
public:
    // Null: not among them.
    const Value* find(uint64_t key) const {
        for (const auto& [known, value] : last_)
            if (known == key) return &value;
        return nullptr;
    }
    const Value& add(uint64_t key, const Value& value) {
        auto& entry = last_[next_++ % last_.size()];
        entry = {key, value};
        return entry.second;
    }

private:
    std::array<std::pair<uint64_t, Value>, 8> last_{};
    size_t next_ = 0;
};

}  // namespace usdmlt
