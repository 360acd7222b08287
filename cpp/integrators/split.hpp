// Selective split: of every path a part goes to bidirectional path tracing, and the rest to the
// chains (as Bitterli & Jarosz 2019, "Selectively metropolised Monte Carlo light transport
// simulation", with weights of our own). The part is a function of the path alone, so that the sum
// of the two is exact.
#pragma once

#include <limits>

#include "paths/subpath.hpp"

namespace usdmlt {

// With r = f*/(q p), p² = Σ_s p_s² (density under the power heuristic) and q the least survival by
// roulette, the chains take
//     g = c²r² / (1 + c²r²)
// of a path, which leaves (1 − g) r < 1/c to bidirectional path tracing: no fireflies. As f* has
// the importance w = (R² + ε)^−½, r is a sample's brightness relative to its own place, f/(q p R),
// by which errors are judged.
struct Split {
    double c_squared = std::numeric_limits<double>::infinity();  // ∞: the chains take everything
    double continuation = 1;  // of the walks of bidirectional path tracing

    bool is_selective() const { return c_squared < std::numeric_limits<double>::infinity(); }
    // Of walks that make a path of so many non-Dirac vertices between its ends.
    double least_survival(int rough_vertices) const {
        double survival = 1;
        for (int i = Continuation::certain; i < rough_vertices; ++i) survival *= continuation;
        return survival;
    }
    double of_chains(double r_squared) const {
        return is_selective() ? 1 / (1 + 1 / (c_squared * r_squared)) : 1;
    }
};

}  // namespace usdmlt
