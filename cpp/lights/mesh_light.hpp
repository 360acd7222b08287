// Emissive triangles of a mesh under an affine transform. They emit from both sides. uv are the
// barycentrics b1, b2 of a triangle.
#pragma once

#include <vector>

#include "base/frame.hpp"
#include "geometry/mesh.hpp"
#include "lights/light.hpp"
#include "materials/material.hpp"

namespace usdmlt {

struct MeshLight {
    const Mesh* mesh = nullptr;
    const Materials* materials = nullptr;
    Affine3f to_world;                // where it moves: at the shutter's opening
    std::span<const Affine3f> later;  // see motion.hpp
    std::vector<uint32_t> triangles;  // those that emit, ascending
    // Of each, at the shutter's opening: 2π · area · average importance of its radiance.
    std::vector<double> flux;

    MeshLight() = default;
    MeshLight(const Mesh& mesh, const Affine3f& to_world, std::span<const Affine3f> later,
              const Materials& materials);
};

LightPoint surface_point(const MeshLight& light, uint32_t triangle, Vec2f uv, float time);
Spectrum surface_radiance(const MeshLight& light, uint32_t triangle, Vec2f uv);
double triangle_area(const MeshLight& light, uint32_t triangle, float time);  // in the world

// Position of a triangle in `triangles`, or invalid_index.
uint32_t emitter_index(const MeshLight& light, uint32_t triangle);

}  // namespace usdmlt
