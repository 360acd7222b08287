// Images that materials and lights read: linear colours of the rendering space, bilinear lookup.
//
// Pixels stay as they are stored (8 or 16 bits, half, float) and are decoded as they are read, so
// that an 8-bit image takes a quarter of what floats would, and images that several materials or
// wrap modes share exist once.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "base/vec.hpp"

namespace usdmlt {

enum class Wrap : uint8_t { black, clamp, repeat, mirror };

struct Texel {
    float c[4];
    float operator[](int i) const { return c[i]; }
};

// Texture coordinate (0, 0) is the lower left corner of the image; row 0 of the data is on top.
struct Texture {
    enum class Depth : uint8_t { byte, word, half, single };

    std::string name;
    int width = 0, height = 0;
    int channels = 0;  // 1 grey, 2 grey and alpha, 3 rgb, 4 rgb and alpha; alpha is 1 if absent
    Wrap wrap_s = Wrap::repeat, wrap_t = Wrap::repeat;
    Depth depth = Depth::single;
    // Channels interleaved; whoever owns the memory lives as long as this.
    std::shared_ptr<const void> pixels;
    // Linear value of each stored one, for colours of bytes (256) and words (65536); null: value /
    // 255 or / 65535. Alpha never has a curve.
    std::shared_ptr<const float> decode;
    // From the image's primaries to those of the rendering space, rows; after filtering, with which
    // it commutes.
    bool has_matrix = false;
    std::array<float, 9> matrix{};

    // The stored texel as (r, g, b, a), column from the left and row from the top, both inside.
    Texel texel(int column, int row) const;

    // Bilinear; texels are squares, so texel centres are at (i + ½) / size. Outside the image, a
    // black wrap is transparent black.
    Texel lookup(Vec2f st) const;

private:
    void read(int column, int row, float out[4]) const;
    Texel finish(const float v[4], float there) const;
};

}  // namespace usdmlt
