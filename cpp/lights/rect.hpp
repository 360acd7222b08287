// RectLight: a parallelogram (a rectangle under an affine transform) that emits towards local −z.
// uv ∈ [0,1]² along local x and y.
#pragma once

#include "base/frame.hpp"
#include "lights/light.hpp"
#include "lights/shaping.hpp"
#include "materials/texture.hpp"

namespace usdmlt {

struct RectLight {
    Spectrum radiance;
    Shaping shaping;
    const Texture* texture = nullptr;
    Vec3f corner, edge_u, edge_v;  // P(u, v) = corner + u·edge_u + v·edge_v
    Vec3f normal;                  // of the emitting side
    double area = 0;
    Vec3d dual_u, dual_v;      // u = (P − corner)·dual_u
    bool rectangular = false;  // the edges are perpendicular

    RectLight() = default;
    RectLight(const Affine3f& transform, float width, float height);
};

LightPoint surface_point(const RectLight& light, Vec2f uv);
Spectrum surface_radiance(const RectLight& light, Vec2f uv);

// Uniform in area.
bool sample_area(const RectLight& light, Vec2f u, Vec2f& uv, double& pdf);
double pdf_area(const RectLight& light, Vec2f uv);

// Uniform in solid angle where the reference is near a true rectangle, uniform in area elsewhere;
// nothing from behind. Densities in area measure.
bool sample_toward(const RectLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf);
double pdf_toward(const RectLight& light, Vec3f reference, Vec2f uv);

// ∫ max(0, n·direction) dA.
double projected_area(const RectLight& light, Vec3d direction);

bool intersect(const RectLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv);
void bounds(const RectLight& light, Vec3f& lower, Vec3f& upper);

}  // namespace usdmlt
