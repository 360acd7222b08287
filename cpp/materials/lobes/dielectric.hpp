// Fresnel of a dielectric interface, as ND_dielectric_bsdf; the scattering is in interface.hpp.
#pragma once

#include "materials/closure.hpp"
#include "materials/fresnel.hpp"

namespace usdmlt::dielectric_lobe {

inline Spectrum reflectance(const Lobe&, float cos_i, float cos_t, float m) {
    return Spectrum(fresnel_dielectric(cos_i, cos_t, m));
}

}  // namespace usdmlt::dielectric_lobe
