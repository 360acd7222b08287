// The target of the plain Metropolis algorithm: a function that is constant on each cell of a grid.
// What a state deposits is its weight, so that the histogram is ∝ f (Veach & Guibas 1997, §2).
//
// States are points of the grid, in cells; T is a density per cell area:
//     uniform       y anywhere                                             T = 1 / cells
//     row           the row of y ∝ the sum of f over it, the rest uniform  T = P(row of y) / width
//     perturbation  y = x + r (cosφ, sinφ), r log-uniform in [r1, r2], φ uniform, as that of the
//                   lens; T(x→y) = T(y→x) = 1 / (2π r² ln(r2/r1)).
// A step that leaves the grid is a rejection.
#pragma once

#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "base/distribution.hpp"
#include "integrators/chain.hpp"

namespace usdmlt {

struct GridPoint {
    double x = 0, y = 0;
    size_t cell = 0;
    double f = 0;
};

class GridTarget {
public:
    using State = GridPoint;
    enum Mutation : int { uniform, row, perturbation, mutation_count };
    static constexpr const char* names[mutation_count] = {"uniform", "row", "perturbation"};

    // f: rows of `width` values, none of them negative, one at least positive.
    GridTarget(std::span<const double> f, size_t width, double r1, double r2)
        : f_(f), width_(width), height_(f.size() / width), r1_(r1), log_range_(std::log(r2 / r1)) {
        std::vector<double> sums(height_, 0.0);
        for (size_t cell = 0; cell < f.size(); ++cell) sums[cell / width] += f[cell];
        rows_ = DiscreteDistribution(sums);
        histogram.assign(f.size(), 0.0);
    }

    std::vector<double> histogram;  // steps spent in each cell, expected values
    RandomStream random;            // of the chain
    bool forget_density = false;    // leaves T out of the ratio: what tests have to notice

    GridPoint point(double x, double y) const {
        const size_t cell = static_cast<size_t>(y) * width_ + static_cast<size_t>(x);
        return {x, y, cell, f_[cell]};
    }

    uint32_t applicable(const State&) const { return (1u << mutation_count) - 1; }

    bool propose(int m, const State& x, State& y) {
        double u = random.next_double(), v = random.next_double();
        if (m == perturbation) {
            const double r = r1_ * std::exp(log_range_ * u), phi = 2 * std::numbers::pi * v;
            u = x.x + r * std::cos(phi);
            v = x.y + r * std::sin(phi);
        } else {
            double probability = 0;
            u *= double(width_);
            v = m == row ? double(rows_.sample(v, probability)) + random.next_1d()
                         : v * double(height_);
        }
        if (!(u >= 0 && v >= 0 && u < double(width_) && v < double(height_))) return false;
        y = point(u, v);
        return y.f > 0;
    }

    double ratio(int m, const State& x, const State& y) const {
        double ratio = y.f / x.f;
        if (m == row && !forget_density) ratio *= row_probability(x) / row_probability(y);
        return ratio;
    }

    void deposit(const State& state, double weight) { histogram[state.cell] += weight; }
    void accept(State& x, const State& y) { x = y; }
    void reject(const State&) {}

private:
    double row_probability(const State& state) const {
        return rows_.probability(state.cell / width_);
    }

    std::span<const double> f_;
    size_t width_, height_;
    double r1_, log_range_;
    DiscreteDistribution rows_;
};

// Σ over `chains` chains of `steps` steps each. Starts are drawn ∝ f, systematically over the
// cells, so that the histogram is ∝ f on average from the first step.
inline ChainCounts run_plain_metropolis(GridTarget& target, std::span<const double> f, size_t width,
                                        const MutationSelection& selection, int64_t chains,
                                        int64_t steps, uint64_t seed) {
    ChainCounts counts(GridTarget::mutation_count);
    const DiscreteDistribution starts(f);
    const double offset = RandomStream(hash_key(seed, 1)).next_double();
    for (int64_t c = 0; c < chains; ++c) {
        target.random = RandomStream(hash_key(hash_key(seed, 2), uint64_t(c)));
        double u = (double(c) + offset) / double(chains), probability = 0;
        const size_t cell = starts.sample(u, probability);
        GridPoint y, x = target.point(double(cell % width) + target.random.next_1d(),
                                      double(cell / width) + target.random.next_1d());
        run_chain(target, selection, x, y, steps, target.random, counts);
    }
    counts.finish();
    return counts;
}

}  // namespace usdmlt
