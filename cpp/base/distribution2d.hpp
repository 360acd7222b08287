// A density on the unit square from a grid of weights, sampled by descending a pyramid of sums.
//
// A node has 4×4 children, one cache line of floats. Each step chooses among them by weights
// relative to their own sum, so that dim cells beside very bright ones keep their full precision in
// float (a cumulative sum over a row would lose them). Both numbers keep their stratification
// (McCool & Harwood 1997; Clarberg et al. 2005).
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

    // weight(x, y) ≥ 0 for x < width, y < height; called once for each.
    template <typename Weight>
    Distribution2D(uint32_t width, uint32_t height, const Weight& weight) {
        levels_.reserve(17);  // references to levels stay valid
        add_level(width, height, weight);
        while (levels_.back().nodes.size() > 1) {
            const Level& below = levels_.back();
            add_level(below.columns, below.rows,
                      [&](uint32_t x, uint32_t y) { return below.node(x, y).sum(); });
        }
        total_ = levels_.back().nodes[0].sum();
    }

    bool empty() const { return !(total_ > 0); }
    double total() const { return total_; }

    // Never a cell of weight zero. Not to be called when empty.
    Cell sample(double u, double v) const {
        // u and v are carried as shares of the weight that is left to descend.
        Cell cell;
        double weight = total_, x = u * weight, y = v * weight;
        for (size_t i = levels_.size(); i-- > 0;) {
            const Node& node = levels_[i].node(cell.x, cell.y);
            double rows[4];
            for (int j = 0; j < 4; ++j) rows[j] = node.row_sum(j);
            const int j = choose(rows, y);
            x *= rows[j] / weight;
            const int k = choose(node.weights[j], x);
            weight = node.weights[j][k];
            y *= weight / rows[j];
            cell.x = 4 * cell.x + k;
            cell.y = 4 * cell.y + j;
        }
        cell.u = std::clamp(x / weight, 0.0, 1 - 0x1p-53);
        cell.v = std::clamp(y / weight, 0.0, 1 - 0x1p-53);
        cell.probability = weight / total_;
        return cell;
    }

private:
    struct alignas(64) Node {
        float weights[4][4] = {};
        double row_sum(int j) const {
            const float* w = weights[j];
            return (double(w[0]) + w[1]) + (double(w[2]) + w[3]);
        }
        double sum() const { return (row_sum(0) + row_sum(1)) + (row_sum(2) + row_sum(3)); }
    };
    struct Level {
        uint32_t columns = 0, rows = 0;
        std::vector<Node> nodes;
        const Node& node(uint32_t x, uint32_t y) const { return nodes[size_t(y) * columns + x]; }
    };

    template <typename Weight>
    void add_level(uint32_t width, uint32_t height, const Weight& weight) {
        Level level{(width + 3) / 4, (height + 3) / 4, {}};
        level.nodes.resize(size_t(level.columns) * level.rows);
        for (uint32_t y = 0; y < height; ++y)
            for (uint32_t x = 0; x < width; ++x)
                level.nodes[size_t(y / 4) * level.columns + x / 4].weights[y % 4][x % 4] =
                    static_cast<float>(weight(x, y));
        levels_.push_back(std::move(level));
    }

    // The interval of positive weight that x is in; x becomes its offset in there.
    template <typename Real>
    static int choose(const Real* weights, double& x) {
        int chosen = 0;
        double start = 0, sum = 0;
        for (int i = 0; i < 4; ++i) {
            if (x >= sum && weights[i] > 0) {
                chosen = i;
                start = sum;
            }
            sum += weights[i];
        }
        x -= start;
        return chosen;
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
