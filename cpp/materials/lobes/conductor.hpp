// Fresnel of a metal, as ND_conductor_bsdf: color0 is the index, color90 the extinction. The
// scattering is in interface.hpp.
#pragma once

#include "materials/closure.hpp"
#include "materials/fresnel.hpp"

namespace usdmlt::conductor_lobe {

inline Spectrum reflectance(const Lobe& lobe, float cos_i) {
    Spectrum f;
    for (int i = 0; i < 3; ++i) f[i] = fresnel_conductor(cos_i, lobe.color0[i], lobe.color90[i]);
    return f;
}

}  // namespace usdmlt::conductor_lobe
