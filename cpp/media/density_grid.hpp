// A scalar field on a regular grid, trilinear between the centres of its cells, constant from the
// outermost ones to the border, and 0 outside.
//
// Along a ray it is a cubic polynomial between two planes through centres, which Simpson's rule
// integrates exactly: optical depths have no other error than rounding.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/frame.hpp"

namespace usdmlt {

struct DensityGrid {
    std::array<int, 3> size{};    // cells along x, y, z
    std::vector<float> values;    // x fastest
    std::vector<float> emission;  // radiance per length, RGB, like `values`; empty: none
    Affine3f to_grid;             // from the scene; cell (i, j, k) has its centre at that point

    bool empty() const { return values.empty(); }

    size_t index(int x, int y, int z) const {
        return (size_t(z) * size_t(size[1]) + size_t(y)) * size_t(size[0]) + size_t(x);
    }

    // At a point of the grid's space within its border.
    float density(Vec3f p) const {
        float out = 0;
        visit(p, [&](size_t i, float w) { out += w * values[i]; });
        return out;
    }
    std::array<double, 3> emission_at(Vec3f p) const {
        std::array<double, 3> out{};
        visit(p, [&](size_t i, float w) {
            for (size_t c = 0; c < 3; ++c) out[c] += double(w) * emission[3 * i + c];
        });
        return out;
    }

    // A stretch of a ray, from a to b, without a plane through centres between.
    struct Piece {
        const DensityGrid& grid;
        Vec3f origin, direction;  // in the grid's space; t as along the scene's ray
        float a, b;
        float at_a, at_b;  // densities

        Vec3f at(float t) const { return origin + direction * t; }
        // ∫ density dt from a to b, or to a point between.
        double integral() const { return integral_to(b, at_b); }
        double integral_to(float t) const { return integral_to(t, grid.density(at(t))); }

    private:
        double integral_to(float t, float at_t) const {
            const double middle = grid.density(at(0.5f * (a + t)));
            return double(t - a) / 6 * (double(at_a) + 4 * middle + at_t);
        }
    };

    // f(piece) for the pieces from t0 to t1, in order, until f is false. False: f was.
    template <typename F>
    bool march(Vec3f origin, Vec3f direction, float t0, float t1, const F& f) const {
        Piece piece{*this, to_grid.point(origin), to_grid.vector(direction), 0, 0, 0, 0};
        const float o[3] = {piece.origin.x, piece.origin.y, piece.origin.z};
        const float d[3] = {piece.direction.x, piece.direction.y, piece.direction.z};
        for (size_t axis = 0; axis < 3; ++axis) {
            const float low = -0.5f, high = float(size[axis]) - 0.5f;
            if (d[axis] == 0) {
                if (o[axis] < low || o[axis] > high) return true;
                continue;
            }
            const float a = (low - o[axis]) / d[axis], b = (high - o[axis]) / d[axis];
            t0 = std::max(t0, std::min(a, b));
            t1 = std::min(t1, std::max(a, b));
        }
        if (!(t0 < t1)) return true;
        constexpr float never = std::numeric_limits<float>::infinity();
        int plane[3], step[3];  // the next one on the way
        float next[3];
        for (size_t axis = 0; axis < 3; ++axis) {
            step[axis] = d[axis] > 0 ? 1 : -1;
            next[axis] = never;
            if (d[axis] == 0) continue;
            const float p = o[axis] + d[axis] * t0;
            plane[axis] = static_cast<int>(d[axis] > 0 ? std::floor(p) + 1 : std::ceil(p) - 1);
            next[axis] = (float(plane[axis]) - o[axis]) / d[axis];
        }
        piece.a = t0;
        piece.at_a = density(piece.at(t0));
        while (piece.a < t1) {
            piece.b = std::min(std::min(next[0], next[1]), std::min(next[2], t1));
            if (piece.b > piece.a) {
                piece.at_b = density(piece.at(piece.b));
                if (!f(std::as_const(piece))) return false;
                piece.a = piece.b;
                piece.at_a = piece.at_b;
            }
            for (size_t axis = 0; axis < 3; ++axis)
                if (next[axis] <= piece.a) {
                    plane[axis] += step[axis];
                    next[axis] = (float(plane[axis]) - o[axis]) / d[axis];
                }
        }
        return true;
    }

private:
    template <typename F>
    void visit(Vec3f p, const F& f) const {
        const float x[3] = {p.x, p.y, p.z};
        int low[3];
        float share[3];
        for (size_t axis = 0; axis < 3; ++axis) {
            const float clamped = std::clamp(x[axis], 0.0f, float(size[axis] - 1));
            low[axis] = std::min(static_cast<int>(clamped), std::max(size[axis] - 2, 0));
            share[axis] = clamped - float(low[axis]);
        }
        for (int corner = 0; corner < 8; ++corner) {
            const int dx = corner & 1, dy = corner >> 1 & 1, dz = corner >> 2;
            const float w = (dx ? share[0] : 1 - share[0]) * (dy ? share[1] : 1 - share[1]) *
                            (dz ? share[2] : 1 - share[2]);
            if (w > 0) f(index(low[0] + dx, low[1] + dy, low[2] + dz), w);
        }
    }
};

}  // namespace usdmlt
