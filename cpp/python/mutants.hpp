// Mutants: transition densities with one factor left out or put in, as a bug would. Tests must see
// each of them, or they would not see the bug.
#pragma once

#include <span>

#include "mutations/mutations.hpp"

namespace usdmlt {

// T(x→y) as mutation m has it.
ScaledDouble healthy_density(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change);

struct Mutant {
    const char* name;
    // T(x→y); `back`: of the way back, to a state that was proposed from y.
    ScaledDouble (*density)(MutationContext& context, int m, const Path& x, const Path& y,
                            const Change& change, bool back);
};

std::span<const Mutant> mutants();

// The terms of T's sum over the splits: their number, and the one with j vertices from the light's
// side. Mutations that do not join have one term, T.
int count_terms(MutationContext& context, int m, const Path& x, const Path& y,
                const Change& change);
ScaledDouble term(MutationContext& context, int m, const Path& x, const Path& y,
                  const Change& change, int j);

// Their sum, every split's density vertex by vertex.
ScaledDouble density_by_definition(MutationContext& context, int m, const Path& x, const Path& y,
                                   const Change& change);

}  // namespace usdmlt
