// Sample numbers for one sample of one pixel: Owen-scrambled Sobol' points, padded by pairs of
// dimensions, then plain random numbers once the stratified dimensions are used up.
//
// Each pair of dimensions is a (0,2)-sequence over the sample index with its own nested uniform
// scramble and its own Owen-shuffled index (Burley 2020, "Practical hash-based Owen scrambling",
// JCGT 9(4)); the scrambling hash has Vegdahl's constants. Every prefix of the index range is
// stratified, so a render can stop anywhere.
#pragma once

#include <cstdint>

#include "base/rng.hpp"

namespace usdmlt {

inline uint32_t reverse_bits(uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// A permutation in which every bit depends only on the bits below it and the seed: a nested uniform
// (Owen) scramble of a number whose bits are reversed.
inline uint32_t permute_upwards(uint32_t x, uint32_t seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// Second dimension of Sobol': the Pascal matrix modulo 2, as an XOR zeta transform over the bits of
// the bit index (binomial C(i, j) is odd exactly when j ⊆ i). Returned bit-reversed.
inline uint32_t sobol_second_reversed(uint32_t x) {
    x ^= (x >> 1) & 0x55555555u;
    x ^= (x >> 2) & 0x33333333u;
    x ^= (x >> 4) & 0x0f0f0f0fu;
    x ^= (x >> 8) & 0x00ff00ffu;
    x ^= (x >> 16) & 0x0000ffffu;
    return x;
}

class Sampler {
public:
    // `key` identifies pixel and seed, `index` the sample.
    Sampler(uint64_t key, uint32_t index, int stratified_pairs)
        : key_(key),
          reversed_index_(reverse_bits(index)),
          pairs_(stratified_pairs),
          stream_(hash_key(key, index)) {}

    Vec2f next_2d() {
        if (pair_ >= pairs_) return stream_.next_2d();
        const uint64_t h = mix64(key_ + uint64_t(++pair_) * 0x9e3779b97f4a7c15ull);
        const uint64_t g = h * 0xd1342543de82ef95ull;
        const uint32_t i = reverse_bits(permute_upwards(reversed_index_, static_cast<uint32_t>(h)));
        return {to_unit_float(reverse_bits(permute_upwards(i, static_cast<uint32_t>(h >> 32)))),
                to_unit_float(reverse_bits(
                    permute_upwards(sobol_second_reversed(i), static_cast<uint32_t>(g >> 32))))};
    }
    float next_1d() { return next_2d().x; }

    // Continues at a pair of dimensions: walks give each decision of a bounce its own, whether or
    // not the others are made, so that a pair means the same in every sample.
    void seek(int pair) { pair_ = pair; }

    // Unstratified numbers of the same sample, for decisions that are rare.
    RandomStream& stream() { return stream_; }

private:
    uint64_t key_;
    uint32_t reversed_index_;
    int pairs_, pair_ = 0;
    RandomStream stream_;
};

}  // namespace usdmlt
