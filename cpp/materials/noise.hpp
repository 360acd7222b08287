// Gradient noise as MaterialX and OSL define it: Perlin 2002, "Improving noise", over a lattice
// hashed by Bob Jenkins's lookup3, scaled so that values lie about within [−1, 1].
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "base/vec.hpp"

namespace usdmlt::noise {

// The last mixing step of lookup3 over `count` integers (burtleburtle.net/bob/c/lookup3.c).
inline uint32_t hash(uint32_t count, int32_t x, int32_t y, int32_t z) {
    const uint32_t start = 0xdeadbeefu + (count << 2) + 13;
    uint32_t a = start + uint32_t(x), b = start + uint32_t(y), c = start + uint32_t(z);
    const auto stir = [](uint32_t& to, uint32_t from, int turn) {
        to = (to ^ from) - std::rotl(from, turn);
    };
    stir(c, b, 14);
    stir(a, c, 11);
    stir(b, a, 25);
    stir(c, b, 16);
    stir(a, c, 4);
    stir(b, a, 14);
    stir(c, b, 24);
    return c;
}

inline float fade(float t) { return t * t * t * (t * (6 * t - 15) + 10); }
inline float signed_by(uint32_t bit, float x) { return bit ? -x : x; }

inline float gradient(uint32_t h, float x, float y) {
    const bool first = (h & 7) < 4;
    return signed_by(h & 1, first ? x : y) + signed_by(h & 2, 2 * (first ? y : x));
}
inline float gradient(uint32_t h, float x, float y, float z) {
    h &= 15;
    const float u = h < 8 ? x : y;
    const float v = h < 4 ? y : h == 12 || h == 14 ? x : z;
    return signed_by(h & 1, u) + signed_by(h & 2, v);
}

// The lattice cell of a coordinate; far out it stays within an int.
inline int32_t cell(float x) { return int32_t(std::fmin(std::fmax(std::floor(x), -2e9f), 2e9f)); }

inline float perlin(Vec2f p) {
    const int32_t i = cell(p.x), j = cell(p.y);
    const float x = p.x - float(i), y = p.y - float(j), u = fade(x), v = fade(y);
    const auto corner = [&](int a, int b) {
        return gradient(hash(2, i + a, j + b, 0), x - float(a), y - float(b));
    };
    return 0.6616f *
           lerp(lerp(corner(0, 0), corner(1, 0), u), lerp(corner(0, 1), corner(1, 1), u), v);
}

inline float perlin(Vec3f p) {
    const int32_t i = cell(p.x), j = cell(p.y), k = cell(p.z);
    const float x = p.x - float(i), y = p.y - float(j), z = p.z - float(k);
    const float u = fade(x), v = fade(y), w = fade(z);
    const auto corner = [&](int a, int b, int c) {
        return gradient(hash(3, i + a, j + b, k + c), x - float(a), y - float(b), z - float(c));
    };
    const auto plane = [&](int c) {
        return lerp(lerp(corner(0, 0, c), corner(1, 0, c), u),
                    lerp(corner(0, 1, c), corner(1, 1, c), u), v);
    };
    return 0.9820f * lerp(plane(0), plane(1), w);
}

// Σ diminish^k · perlin(lacunarity^k · p).
inline float fractal(Vec3f p, int octaves, float lacunarity, float diminish) {
    float sum = 0, amplitude = 1;
    for (int k = 0; k < octaves; ++k) {
        sum += amplitude * perlin(p);
        amplitude *= diminish;
        p = p * lacunarity;
    }
    return sum;
}

}  // namespace usdmlt::noise
