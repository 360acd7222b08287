// A density on the unit square from a grid of weights, sampled by descending a pyramid of sums.
//
// Each step chooses among four children with weights relative to their own sum, so that dim cells
// beside very bright ones keep their full precision in float (a cumulative sum would lose them),
// and the four lie in one cache line. Stratification of both numbers is kept (Clarberg et al. 2005,
// McCool & Harwood 1997).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/vec.hpp"

namespace usdmlt {

class Distribution2D {
public:
    struct Cell {
        uint32_t x = 0, y = 0;
        double u = 0, v = 0;  // fresh uniform numbers
        double probability = 0;
    };

    Distribution2D() = default;

    // weight(x, y) ≥ 0 for x < width, y < height.
    template <typename Weight>
    Distribution2D(uint32_t width, uint32_t height, const Weight& weight) {
        levels_.reserve(33);  // references to levels stay valid
        add_level(width, height, weight);
        while (size_t(levels_.back().blocks_x) * levels_.back().blocks_y > 1) {
            const Level& below = levels_.back();
            add_level(below.blocks_x, below.blocks_y, [&](uint32_t x, uint32_t y) {
                const float* c = below.block(x, y);
                return (c[0] + c[1]) + (c[2] + c[3]);
            });
        }
        const float* root = levels_.back().block(0, 0);
        total_ = (double(root[0]) + root[1]) + (double(root[2]) + root[3]);
    }

    bool empty() const { return !(total_ > 0); }
    double total() const { return total_; }

    // Never a cell of weight zero. Not to be called when empty.
    Cell sample(double u, double v) const {
        // u and v are kept as fractions of the weight of the node that is descended.
        Cell cell;
        double node = total_, x = u * node, y = v * node;
        for (size_t i = levels_.size(); i-- > 0;) {
            const float* c = levels_[i].block(cell.x, cell.y);
            const double top = double(c[0]) + c[1], bottom = double(c[2]) + c[3];
            const bool down = y >= top && bottom > 0;
            const double row = down ? bottom : top;
            if (down) y -= top;
            x *= row / node;
            const double left = c[2 * down], right = c[2 * down + 1];
            const bool across = x >= left && right > 0;
            node = across ? right : left;
            if (across) x -= left;
            y *= node / row;
            cell.x = 2 * cell.x + across;
            cell.y = 2 * cell.y + down;
        }
        cell.u = std::clamp(x / node, 0.0, 1 - 0x1p-53);
        cell.v = std::clamp(y / node, 0.0, 1 - 0x1p-53);
        cell.probability = node / total_;
        return cell;
    }

private:
    struct Level {
        uint32_t blocks_x = 0, blocks_y = 0;
        std::vector<float> weights;  // blocks of 2×2: [y][x][2·(y&1) + (x&1)]
        const float* block(uint32_t x, uint32_t y) const {
            return weights.data() + 4 * (size_t(y) * blocks_x + x);
        }
    };

    template <typename Weight>
    void add_level(uint32_t width, uint32_t height, const Weight& weight) {
        Level level{(width + 1) / 2, (height + 1) / 2, {}};
        level.weights.assign(4 * size_t(level.blocks_x) * level.blocks_y, 0.0f);
        for (uint32_t y = 0; y < height; ++y)
            for (uint32_t x = 0; x < width; ++x)
                level
                    .weights[4 * (size_t(y / 2) * level.blocks_x + x / 2) + 2 * (y & 1) + (x & 1)] =
                    static_cast<float>(weight(x, y));
        levels_.push_back(std::move(level));
    }

    std::vector<Level> levels_;
    double total_ = 0;
};

// x ∈ [0, 1] with density ∝ (1−x)·a + x·b.
inline double sample_linear(double u, double a, double b) {
    const double denominator = a + std::sqrt((1 - u) * a * a + u * b * b);
    return denominator > 0 ? std::min(u * (a + b) / denominator, 1.0) : u;
}

}  // namespace usdmlt
