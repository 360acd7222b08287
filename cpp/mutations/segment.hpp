// New runs of vertices by ordinary sampling from both kept ends, joined by one edge.
#pragma once

#include "mutations/context.hpp"

namespace usdmlt {

// y from x with `from_light` new vertices after x_l and `from_eye` new ones before x_m, x_0 by
// direct sampling where it is the only vertex of the light's side. False where a walk ends early or
// the two sides cannot be joined. context.recorded becomes the density of the new vertices.
bool make_segment(MutationContext& context, const Path& x, Change& change, int from_light,
                  int from_eye, Path& y);

// Densities of all the ways to make y_{l+1} … y_{m_y−1}: the sum over the numbers j of vertices
// from the light's side, each times weight(j).
template <typename Weight>
ScaledDouble sum_over_splits(MutationContext& context, const Path& y, int l, int m_y,
                             const Weight& weight) {
    // E_j = ∏_{i > l + j} p_E(y_i), from the eye to the light: division would lose zeros.
    const int n = m_y - l - 1;
    std::vector<ScaledDouble>& eye_products = context.scratch.scaled;
    const auto eye = [&](int j) -> ScaledDouble& { return eye_products[static_cast<size_t>(j)]; };
    eye(n) = 1;
    for (int j = n - 1; j >= 0; --j) {
        eye(j) = eye(j + 1);
        if (eye(j).mantissa != 0) eye(j) *= density_from_eye(context, y, l + 1 + j);
    }
    ScaledDouble sum = 0, light = 1;
    for (int j = 0; j <= n; ++j) {
        const int s = l + 1 + j;
        if (j > 0) light *= density_from_light_side(context.scene, y, s - 1);
        if (light.mantissa == 0) break;
        const double w = weight(j);
        if (!(w > 0) || eye(j).mantissa == 0 || !has_strategy(y, s)) continue;
        ScaledDouble p = eye(j);
        if (l == -1 && s == 1)
            p *= pdf_direct(context.scene.lights, y[0].light, y[1].position);
        else
            p *= light;
        sum += p * w;
    }
    return sum;
}

}  // namespace usdmlt
