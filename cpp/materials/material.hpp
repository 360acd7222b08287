// Materials: small programs that make the closure of a surface point from constants, textures and
// primvars.
//
// A program is a closure tree in postfix order. Lobe operations push lobes; layer, mix, add and
// multiply combine the last one or two operands. It runs once per path vertex; programs that do not
// depend on the position run once when the material is finished, and are copied per vertex.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/mesh.hpp"
#include "materials/closure.hpp"
#include "materials/parameter.hpp"
#include "materials/texture.hpp"

namespace usdmlt {

// Parameters of each operation, in this order, start at Operation::parameter.
enum class OperationType : uint8_t {
    diffuse,          // color, weight, roughness
    translucent,      // color, weight
    dielectric,       // ior, roughness x, roughness y, tint, weight
    conductor,        // ior, extinction, roughness x, roughness y, weight
    schlick,          // color0, color90, exponent, roughness x, roughness y, weight
    emission,         // color
    preview_surface,  // diffuseColor, emissiveColor, specularColor, metallic, roughness,
                      // clearcoat, clearcoatRoughness, opacity, ior
    layer,            // top, base →
    mix,              // foreground, background → ; mix
    add,              // a, b →
    multiply,         // closure → ; factor
};

struct Operation {
    OperationType type;
    bool reflects = true, transmits = false;  // dielectric, schlick: the scatter mode
    bool specular_workflow = false;           // preview_surface
    uint32_t parameter = 0;                   // first of its parameters
};

struct Material {
    std::string name;
    std::vector<Operation> operations;  // empty: absorbs
    std::vector<Parameter> parameters;
    std::vector<TextureRead> reads;
    Parameter opacity{.value = Spectrum(1.0f)};
    float opacity_threshold = 0;  // > 0: cut-out, there where opacity ≥ threshold
    Parameter normal;             // tangent space, [−1, 1]
    bool has_normal_map = false;
    uint32_t tangent_primvar = invalid_index;  // slot of the (s, t) that +s tangents come from

    // Set by finish_material.
    bool is_constant = false;    // `folded` is the closure everywhere
    bool has_interface = false;  // something refracts: reflecting lobes see sides
    bool is_emissive = false;
    bool is_opaque = true;
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
Vec3f tangent_along_s(const Mesh& mesh, uint32_t triangle, uint32_t primvar);

}  // namespace usdmlt
