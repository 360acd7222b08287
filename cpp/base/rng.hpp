// Counted random streams: number n of a stream is a function of (key, n) and of nothing else.
#pragma once

#include <cstdint>

#include "base/vec.hpp"

namespace usdmlt {

// Finaliser of SplitMix64 (Steele, Lea & Flood 2014; Stafford's variant 13).
inline uint64_t mix64(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
}

inline uint64_t hash_key(uint64_t a, uint64_t b) {
    return mix64(a * 0x9e3779b97f4a7c15ull + mix64(b + 0x632be59bd9b4e019ull));
}

// 24 bits of mantissa: [0, 1).
inline float to_unit_float(uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

class RandomStream {
public:
    RandomStream() = default;
    explicit RandomStream(uint64_t key) : state_(mix64(key)) {}

    uint64_t next_u64() { return mix64(state_ += 0x9e3779b97f4a7c15ull); }
    float next_1d() { return to_unit_float(static_cast<uint32_t>(next_u64() >> 32)); }
    Vec2f next_2d() {
        const uint64_t z = next_u64();
        return {to_unit_float(static_cast<uint32_t>(z >> 32)),
                to_unit_float(static_cast<uint32_t>(z))};
    }
    double next_double() { return static_cast<double>(next_u64() >> 11) * 0x1p-53; }

private:
    uint64_t state_ = 0;
};

}  // namespace usdmlt
