// CylinderLight: a cylinder along local x under an affine transform, without caps, that emits
// outward. uv ∈ [0,1]²: position along the axis, and φ/2π from local y towards z.
#pragma once

#include "base/frame.hpp"
#include "lights/light.hpp"
#include "lights/shaping.hpp"

namespace usdmlt {

struct CylinderLight {
    Spectrum radiance;
    Shaping shaping;
    Affine3f from_unit;                     // of x ∈ [0,1], y² + z² = 1
    Vec3d to_unit_x, to_unit_y, to_unit_z;  // rows of the inverse, about the origin
    double determinant = 0;                 // of the linear part, absolute
    double area = 0;

    CylinderLight() = default;
    CylinderLight(const Affine3f& transform, float radius, float length);
};

LightPoint surface_point(const CylinderLight& light, Vec2f uv);

// Uniform in uv.
bool sample_area(const CylinderLight& light, Vec2f u, Vec2f& uv, double& pdf);
double pdf_area(const CylinderLight& light, Vec2f uv);

// φ uniform in the angle that the cross-section subtends, then equiangular along the line of that
// φ. Nothing from inside.
bool sample_toward(const CylinderLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf);
double pdf_toward(const CylinderLight& light, Vec3f reference, Vec2f uv);

double projected_area(const CylinderLight& light, Vec3d direction);

bool intersect(const CylinderLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv);
void bounds(const CylinderLight& light, Vec3f& lower, Vec3f& upper);

}  // namespace usdmlt
