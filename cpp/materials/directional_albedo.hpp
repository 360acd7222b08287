// Directional albedos: the share of the light from one direction that a lobe reflects,
//     E(ω) = ∫ f_r(ω, ω') |cosθ'| dω',
// for layering and for the choice between lobes.
#pragma once

#include "materials/closure.hpp"

namespace usdmlt {

// E of a dielectric, conductor, Schlick or sheen lobe that reflects, its weight not included. `w`
// is local. Exact for smooth lobes; for rough ones from a table that is computed at the first call
// (20 ms), within 0.01 but for grazing angles on almost smooth surfaces (0.02) and total reflection
// (0.03).
Spectrum reflection_albedo(const Lobe& lobe, Vec3f w);

// Its cosine-weighted mean over the directions outside, ∫ E |cosθ| dω / π, for equal alphas.
Spectrum average_reflection_albedo(const Lobe& lobe);

}  // namespace usdmlt
