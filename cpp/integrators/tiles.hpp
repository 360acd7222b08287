// The units of the sampling integrators: one sample per pixel of one tile. Unit u is tile u mod
// tiles of pass u / tiles, so that every prefix is a picture.
#pragma once

#include <algorithm>
#include <cstdint>

namespace usdmlt {

struct Tiles {
    static constexpr int size = 64;
    int width, height, across, down;

    Tiles(int width, int height)
        : width(width),
          height(height),
          across((width + size - 1) / size),
          down((height + size - 1) / size) {}

    int64_t count() const { return int64_t(across) * down; }

    struct Unit {
        int x0, y0, x1, y1;
        uint32_t pass;
    };
    Unit unit(int64_t index) const {
        const int64_t tile = index % count();
        const int x = static_cast<int>(tile % across) * size;
        const int y = static_cast<int>(tile / across) * size;
        return {x, y, std::min(x + size, width), std::min(y + size, height),
                static_cast<uint32_t>(index / count())};
    }
};

}  // namespace usdmlt
