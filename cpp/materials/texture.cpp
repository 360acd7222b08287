#include "materials/texture.hpp"

#include <cmath>
#include <cstring>

#include "materials/half.hpp"

namespace usdmlt {

namespace {

// Reads of four channels at the last pixel of a texture with fewer stay inside the array.
constexpr size_t padding = 3;

// Index of a texel in [0, size), or −1: outside, black.
int wrap_index(int i, int size, Wrap wrap) {
    if (i >= 0 && i < size) return i;
    switch (wrap) {
        case Wrap::black:
            return -1;
        case Wrap::clamp:
            return i < 0 ? 0 : size - 1;
        case Wrap::repeat:
            i %= size;
            return i < 0 ? i + size : i;
        case Wrap::mirror:
            i %= 2 * size;
            if (i < 0) i += 2 * size;
            return i < size ? i : 2 * size - 1 - i;
    }
    return -1;
}

// Brings a periodic coordinate near the image, where the texel index fits an int and the fraction
// keeps its precision; far outside the others, the nearest place with the same result.
float reduce_coordinate(float s, Wrap wrap) {
    if (!std::isfinite(s)) return 0;
    switch (wrap) {
        case Wrap::repeat:
            return s - std::floor(s);
        case Wrap::mirror:
            return s - 2 * std::floor(0.5f * s);
        case Wrap::black:
        case Wrap::clamp:
            break;
    }
    return std::clamp(s, -4.0f, 4.0f);
}

// Stored channels to (r, g, b, a); `there` is the alpha of an image that has none.
Texel expand(const float v[4], int channels, float there) {
    switch (channels) {
        case 1:
            return {{v[0], v[0], v[0], there}};
        case 2:
            return {{v[0], v[0], v[0], v[1]}};
        case 3:
            return {{v[0], v[1], v[2], there}};
        default:
            return {{v[0], v[1], v[2], v[3]}};
    }
}

}  // namespace

void Texture::resize(int new_width, int new_height, int new_channels, bool half) {
    width = new_width;
    height = new_height;
    channels = new_channels;
    const size_t count = size_t(width) * size_t(height) * size_t(channels) + padding;
    halves.assign(half ? count : 0, 0);
    floats.assign(half ? 0 : count, 0.0f);
}

void Texture::read(int column, int row, float out[4]) const {
    const size_t i = (size_t(row) * size_t(width) + size_t(column)) * size_t(channels);
    if (!halves.empty())
        halves_to_floats(halves.data() + i, out);
    else
        std::memcpy(out, floats.data() + i, 4 * sizeof(float));
}

Texel Texture::texel(int column, int row) const {
    float v[4];
    read(column, row, v);
    return expand(v, channels, 1);
}

Texel Texture::lookup(Vec2f st) const {
    const float x = reduce_coordinate(st.x, wrap_s) * float(width) - 0.5f;
    const float y = (1 - reduce_coordinate(st.y, wrap_t)) * float(height) - 0.5f;
    const float x_floor = std::floor(x), y_floor = std::floor(y);
    const float fx = x - x_floor, fy = y - y_floor;

    const int columns[2] = {wrap_index(int(x_floor), width, wrap_s),
                            wrap_index(int(x_floor) + 1, width, wrap_s)};
    const int rows[2] = {wrap_index(int(y_floor), height, wrap_t),
                         wrap_index(int(y_floor) + 1, height, wrap_t)};
    const float weights[2][2] = {{(1 - fx) * (1 - fy), fx * (1 - fy)}, {(1 - fx) * fy, fx * fy}};

    float sum[4] = {0, 0, 0, 0}, there = 0;
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i) {
            const float w = weights[j][i];
            // A texel of weight 0 is not read: infinities in it would become NaN.
            if (columns[i] < 0 || rows[j] < 0 || w == 0) continue;
            float v[4];
            read(columns[i], rows[j], v);
            for (int k = 0; k < 4; ++k) sum[k] += w * v[k];
            there += w;
        }
    return expand(sum, channels, there);
}

}  // namespace usdmlt
