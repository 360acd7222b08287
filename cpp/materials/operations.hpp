// The operations of a material's closure: lobes, and what combines them.
//
// A closure tree in postfix order. Lobe operations push lobes; layer, mix, add and multiply combine
// the last one or two operands. Their inputs are operands of the material's pattern program.
#pragma once

#include <cstdint>

#include "materials/closure.hpp"
#include "materials/program.hpp"

namespace usdmlt {

struct Material;

// Inputs of each operation, in this order, start at Operation::parameter.
enum class OperationType : uint8_t {
    diffuse,          // color, weight, roughness
    eon,              // color, weight, roughness
    translucent,      // color, weight
    dielectric,       // ior, roughness x, roughness y, tint, tints of reflection and transmission,
                      // weight
    conductor,        // ior, extinction, roughness x, roughness y, weight
    schlick,          // color0, color82, color90, exponent, roughness x, roughness y, weight
    sheen,            // color, weight, roughness
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
    uint32_t parameter = 0;                   // first of its inputs
};

// What an operation takes and leaves; `lobes` is the most it can push.
struct Arity {
    int parameters, operands, lobes;
};
int parameter_count(OperationType type);
Arity arity(const Material& material, const Operation& op);

// A scale that is certainly 0, or certainly 1, everywhere.
bool always(const Material& material, Operand operand, float value);

// Runs all operations and fills everything of `closure` but its normals.
void run_operations(const Material& material, const Values& values, Closure& closure);

// The emission of the closure that run_operations would make.
Spectrum run_emission(const Material& material, const Values& values);

}  // namespace usdmlt
