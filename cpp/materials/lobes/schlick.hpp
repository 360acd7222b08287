// Generalised Schlick reflectance, as ND_generalized_schlick_bsdf; the scattering is in
// interface.hpp.
//
// Schlick's curve is fitted to the angle on the side of the smaller index (Schlick 1994, §3.2.1).
// Where the lobe bounds a denser medium, light from inside therefore uses the refracted angle,
// which makes the reflectance the same from both sides and full (color90) under total reflection.
#pragma once

#include "materials/closure.hpp"
#include "materials/fresnel.hpp"

namespace usdmlt::schlick_lobe {

inline Spectrum reflectance(const Lobe& lobe, float cos_i, float cos_t, float m) {
    const float cos_rare = lobe.is_interface && m < 1 ? cos_t : cos_i;
    const Spectrum f = fresnel_schlick(cos_rare, lobe.color0, lobe.color90, lobe.exponent);
    if (is_black(lobe.edge)) return f;
    Spectrum tinted = f - lobe.edge * edge_curve(cos_rare);
    for (int i = 0; i < 3; ++i) tinted[i] = clamp01(tinted[i]);
    return tinted;
}

}  // namespace usdmlt::schlick_lobe
