// SphereLight: an ellipsoid (a sphere under an affine transform) that emits outward. uv ∈ [−1,1]²
// is the octahedral map of the unit sphere, precise everywhere and without trigonometry.
#pragma once

#include "base/frame.hpp"
#include "lights/light.hpp"
#include "lights/shaping.hpp"

namespace usdmlt {

struct SphereLight {
    Spectrum radiance;
    Shaping shaping;
    Affine3f from_unit;                     // of the unit sphere
    Vec3d to_unit_x, to_unit_y, to_unit_z;  // rows of the inverse, about the centre
    Vec3d cofactor_x, cofactor_y, cofactor_z;
    double determinant = 0;  // of the linear part, absolute
    double area = 0;

    SphereLight() = default;
    SphereLight(const Affine3f& transform, float radius);
};

LightPoint surface_point(const SphereLight& light, Vec2f uv);

// Uniform on the unit sphere before the transform.
bool sample_area(const SphereLight& light, Vec2f u, Vec2f& uv, double& pdf);
double pdf_area(const SphereLight& light, Vec2f uv);

// Uniform in the solid angle of the visible cap, measured before the transform: exact solid-angle
// sampling of true spheres. Nothing from inside.
bool sample_toward(const SphereLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf);
double pdf_toward(const SphereLight& light, Vec3f reference, Vec2f uv);

double projected_area(const SphereLight& light, Vec3d direction);

bool intersect(const SphereLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv);
void bounds(const SphereLight& light, Vec3f& lower, Vec3f& upper);

}  // namespace usdmlt
