// DiskLight: an ellipse (a disk under an affine transform) that emits towards local −z. uv is in
// the unit disk, along local x and y.
#pragma once

#include "base/frame.hpp"
#include "lights/light.hpp"
#include "lights/shaping.hpp"

namespace usdmlt {

struct DiskLight {
    Spectrum radiance;
    Shaping shaping;
    Vec3f center, axis_u, axis_v;  // P(u, v) = center + u·axis_u + v·axis_v
    Vec3f normal;                  // of the emitting side
    double area = 0;
    Vec3d dual_u, dual_v;  // u = (P − center)·dual_u

    DiskLight() = default;
    DiskLight(const Affine3f& transform, float radius);
};

LightPoint surface_point(const DiskLight& light, Vec2f uv);

// Uniform in area; towards a reference too, but nothing from behind.
bool sample_area(const DiskLight& light, Vec2f u, Vec2f& uv, double& pdf);
double pdf_area(const DiskLight& light, Vec2f uv);
bool sample_toward(const DiskLight& light, Vec3f reference, Vec2f u, Vec2f& uv, double& pdf);
double pdf_toward(const DiskLight& light, Vec3f reference, Vec2f uv);

double projected_area(const DiskLight& light, Vec3d direction);

bool intersect(const DiskLight& light, Vec3f origin, Vec3f direction, float tnear, float tfar,
               float& t, Vec2f& uv);
void bounds(const DiskLight& light, Vec3f& lower, Vec3f& upper);

}  // namespace usdmlt
