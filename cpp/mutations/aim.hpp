// How a perturbed walk leaves a vertex so that it goes through the chain of Dirac and near-specular
// vertices that the old one went through, and arrives about where that did.
//
// The direction is found by iteration, as manifold walks are (Jakob & Marschner 2012), but it needs
// not be exact: it is only the middle of the density from which the direction is drawn, and a
// function of the old path and the new vertex, so that T can be told both ways. How far the chain
// throws small changes of the direction gives the density its shape (as derivatives of f do in Li
// et al. 2015, "Anisotropic Gaussian mutations for Metropolis light transport").
#pragma once

#include "mutations/walk.hpp"

namespace usdmlt {

// Of the chain that leaves x_i, where the walk has come to v instead.
AimedDirection aim(MutationContext& context, const Path& x, const Walk& walk, int i,
                   const Vertex& v);

}  // namespace usdmlt
