#include "materials/texture.hpp"

#include <cmath>
#include <cstring>

#include "materials/half.hpp"

namespace usdmlt {

namespace {

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

}  // namespace

// All stored channels, decoded.
void Texture::read(int column, int row, float out[4]) const {
    const size_t i = (size_t(row) * size_t(width) + size_t(column)) * size_t(channels);
    const int colors = channels < 3 ? 1 : 3;
    const auto decoded = [&](const auto* stored, float top) {
        for (int k = 0; k < channels; ++k)
            out[k] = decode && k < colors ? decode.get()[stored[k]] : float(stored[k]) * (1 / top);
    };
    switch (depth) {
        case Depth::byte:
            decoded(static_cast<const uint8_t*>(pixels.get()) + i, 255.0f);
            break;
        case Depth::word:
            decoded(static_cast<const uint16_t*>(pixels.get()) + i, 65535.0f);
            break;
        case Depth::half: {
            const uint16_t* halves = static_cast<const uint16_t*>(pixels.get()) + i;
            if (channels == 4)
                halves_to_floats(halves, out);
            else
                for (int k = 0; k < channels; ++k) out[k] = half_to_float(halves[k]);
            break;
        }
        case Depth::single:
            std::memcpy(out, static_cast<const float*>(pixels.get()) + i,
                        size_t(channels) * sizeof(float));
    }
}

// Stored channels to (r, g, b, a); `there` is the alpha of an image that has none.
Texel Texture::finish(const float v[4], float there) const {
    if (channels < 3) return {{v[0], v[0], v[0], channels == 2 ? v[1] : there}};
    const float alpha = channels == 4 ? v[3] : there;
    if (!has_matrix) return {{v[0], v[1], v[2], alpha}};
    const auto row = [&](int i) {
        return matrix[i] * v[0] + matrix[i + 1] * v[1] + matrix[i + 2] * v[2];
    };
    return {{row(0), row(3), row(6), alpha}};
}

Texel Texture::texel(int column, int row) const {
    float v[4];
    read(column, row, v);
    return finish(v, 1);
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
            for (int k = 0; k < channels; ++k) sum[k] += w * v[k];
            there += w;
        }
    return finish(sum, there);
}

}  // namespace usdmlt
