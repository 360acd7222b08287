// DomeLight: an environment of constant radiance or a lat-long texture. In the dome's space
// t = acos(y)/π runs from the top row (+y), s = ½ − atan2(x, z)/2π: the centre column is +z.
//
// A textured dome is sampled by a density over (s, t) that interpolates importance × sinθ of the
// texels bilinearly, as the radiance itself is interpolated: positive wherever the radiance is,
// and proportional to it up to the variation of sinθ across one texel.
#pragma once

#include <vector>

#include "base/distribution2d.hpp"
#include "base/frame.hpp"
#include "base/spectrum.hpp"
#include "materials/texture.hpp"

namespace usdmlt {

struct DomeLight {
    Spectrum radiance;
    const Texture* texture = nullptr;
    Affine3f to_world, from_world;
    double determinant = 1;       // of to_world, absolute
    Distribution2D cells;         // between texel centres: w × (h + 1), the outer rows half high
    std::vector<float> row_sine;  // sinθ of the texel rows with the poles before and after
    Spectrum average{1.0f};       // of the texture over the sphere

    DomeLight() = default;
    DomeLight(const Affine3f& transform, const Spectrum& radiance, const Texture* texture);
};

// Directions are from the scene towards the dome.
Vec3f sample_incoming(const DomeLight& light, Vec2f u);
double pdf_incoming(const DomeLight& light, Vec3f direction);
Spectrum incoming_radiance(const DomeLight& light, Vec3f direction);

// ∫ L dω.
Spectrum integrated_radiance(const DomeLight& light);

}  // namespace usdmlt
