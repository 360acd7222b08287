// IEEE 754 binary16, as textures store it.
#pragma once

#include <bit>
#include <cstdint>

#if defined(__F16C__)
#include <immintrin.h>
#endif

namespace usdmlt {

// Exact: every half is a float. Subnormals are scaled by a float subtraction that normalises them.
inline float half_to_float_portable(uint16_t half) {
    const uint32_t sign = static_cast<uint32_t>(half & 0x8000u) << 16;
    const uint32_t magnitude = half & 0x7fffu;
    uint32_t bits = (magnitude << 13) + ((127 - 15) << 23);
    if (magnitude >= 0x7c00u) {  // infinity, NaN: the exponent field is all ones
        bits += (128 - 16) << 23;
    } else if (magnitude < 0x0400u) {  // zero, subnormal: m·2⁻²⁴
        bits = std::bit_cast<uint32_t>(std::bit_cast<float>(bits + (1u << 23)) - 0x1p-14f);
    }
    return std::bit_cast<float>(bits | sign);
}

inline float half_to_float(uint16_t half) {
#if defined(__F16C__)
    return _cvtsh_ss(half);
#else
    return half_to_float_portable(half);
#endif
}

// Four at once; reads 8 bytes.
inline void halves_to_floats(const uint16_t* halves, float out[4]) {
#if defined(__F16C__)
    const __m128i bits = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(halves));
    _mm_storeu_ps(out, _mm_cvtph_ps(bits));
#else
    for (int i = 0; i < 4; ++i) out[i] = half_to_float_portable(halves[i]);
#endif
}

}  // namespace usdmlt
