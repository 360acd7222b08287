// Lens-subpath mutation (Veach & Guibas 1997, §5.3.3): the eye's part (L|D) D S* E is made anew
// from a point of the whole image: a walk through Dirac vertices, component by component as chosen,
// until one scatters otherwise; that vertex is connected to the old x_l. S* may become longer or
// shorter.
//     T(x→y) = p_raster ∏_S P_c · p(stop) · densities of the traced vertices.
// The lens point is kept. Image points are stratified: proposal number i of the chains of one unit
// takes the points of one randomised Sobol' set, each of which is uniform by itself.
#pragma once

#include "mutations/context.hpp"

namespace usdmlt {

struct LensSubpath {
    static constexpr const char* name = "lens_subpath";
    static constexpr bool by_class = true;

    static bool applies(const MutationContext&, const Path& x);
    static bool propose(MutationContext& context, const Path& x, Path& y, Change& change);
    static ScaledDouble density(MutationContext& context, const Path& x, const Path& y,
                                const Change& change);
};

}  // namespace usdmlt
