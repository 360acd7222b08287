// Materials: what makes the closure of a surface point from constants, textures and primvars.
//
// A pattern program computes the inputs, operations make lobes of them. Both run once per path
// vertex; materials that do not depend on the position are run once when they are finished, and
// their closure is copied per vertex.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/mesh.hpp"
#include "materials/closure.hpp"
#include "materials/operations.hpp"
#include "materials/program.hpp"
#include "materials/texture.hpp"

namespace usdmlt {

struct Material {
    std::string name;
    std::vector<Operation> operations;  // empty: absorbs
    Program program;
    std::vector<Operand> parameters;  // of the operations
    Operand opacity;
    float opacity_threshold = 0;  // > 0: cut-out, there where opacity ≥ threshold
    Operand normal;               // tangent space, [−1, 1]
    bool has_normal_map = false;
    bool thin_walled = false;                  // bounds no medium: both sides are the outside
    Operand tangent_rotation;                  // turns, about the shading normal
    uint32_t tangent_primvar = invalid_index;  // slot of the (s, t) that +s tangents come from

    // Set by finish_material.
    bool is_constant = false;    // `folded` is the closure everywhere
    bool has_interface = false;  // something refracts: reflecting lobes see sides
    bool is_emissive = false;
    bool is_opaque = true;
    Schedule scattering_schedule, emission_schedule, opacity_schedule;
    Closure folded;
};

struct Materials {
    std::vector<Texture> textures;
    std::vector<Material> materials;
};

// Checks and folds a material whose operations and parameters are set. Throws
// std::invalid_argument, naming the material, for a malformed program or one with more than
// max_lobes lobes.
void finish_material(Materials& materials, uint32_t material);

// Fills `closure` for the point (1−b1−b2, b1, b2) of a triangle. The caller has set closure.shading
// and closure.geometric_normal; a normal map and anisotropy replace the shading frame. `dpds` is
// the world tangent along +s of the material's tangent_primvar, or zero; `mirrored` tells that the
// transform to world flips handedness.
void evaluate_material(const Materials& materials, uint32_t material, const Mesh& mesh,
                       uint32_t triangle, float b1, float b2, const Vec3f& dpds, Closure& closure,
                       bool mirrored = false);

// The emission that evaluate_material would give, without the rest.
Spectrum emission(const Materials& materials, uint32_t material, const Mesh& mesh,
                  uint32_t triangle, float b1, float b2);

// How much of the surface is there: 0 or 1 with a threshold, else anything in [0, 1].
float opacity(const Materials& materials, uint32_t material, const Mesh& mesh, uint32_t triangle,
              float b1, float b2);

inline bool is_emissive(const Materials& materials, uint32_t material) {
    return materials.materials[material].is_emissive;
}
inline bool is_opaque(const Materials& materials, uint32_t material) {
    return materials.materials[material].is_opaque;
}

// ∂p/∂s in the mesh's own space, for `dpds` (transform it to world as a vector). Zero where the
// mesh lacks the primvar or its coordinates are degenerate.
Vec3f tangent_along_s(const Mesh& mesh, uint32_t triangle, uint32_t primvar, float time = 0);

}  // namespace usdmlt
