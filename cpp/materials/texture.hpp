// Images that materials and lights read: linear colours of the rendering space, bilinear lookup.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.hpp"

namespace usdmlt {

enum class Wrap : uint8_t { black, clamp, repeat, mirror };

struct Texel {
    float c[4];
    float operator[](int i) const { return c[i]; }
};

// Texture coordinate (0, 0) is the lower left corner of the image; row 0 of the data is on top.
// Either `halves` (IEEE binary16) or `floats` holds the pixels, channels interleaved.
struct Texture {
    std::string name;
    int width = 0, height = 0;
    int channels = 0;  // 1 grey, 2 grey and alpha, 3 rgb, 4 rgb and alpha; alpha is 1 if absent
    Wrap wrap_s = Wrap::repeat, wrap_t = Wrap::repeat;
    std::vector<uint16_t> halves;
    std::vector<float> floats;

    // Makes room for width × height pixels: `halves` if `half`, else `floats`. Call before filling.
    void resize(int width, int height, int channels, bool half);

    // The stored texel as (r, g, b, a), column from the left and row from the top, both inside.
    Texel texel(int column, int row) const;

    // Bilinear; texels are squares, so texel centres are at (i + ½) / size. Outside the image, a
    // black wrap is transparent black.
    Texel lookup(Vec2f st) const;

private:
    // All stored channels, and whatever follows them up to four.
    void read(int column, int row, float out[4]) const;
};

}  // namespace usdmlt
