// Pattern programs: what feeds the inputs of a material, as a flat list of instructions.
//
// A graph of texture, primvar, arithmetic and colour nodes becomes instructions in an order in
// which every one finds its inputs ready; each writes one register of four floats. Whatever does
// not depend on the surface is computed while the program is built and becomes a constant.
// At a path vertex only the instructions that the wanted results need are run, once each, and
// nothing is allocated.
//
// A number fills all four lanes of its register, so numbers and colours mix without conversion.
// Lanes beyond an instruction's width hold nothing of use.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/spectrum.hpp"
#include "geometry/mesh.hpp"
#include "materials/texture.hpp"

namespace usdmlt {

struct Node;  // nodes.hpp

using Value = Texel;

// A constant of a program, or the register of an instruction.
struct Operand {
    static constexpr uint16_t register_bit = 0x8000;
    uint16_t index = 0;

    bool is_constant() const { return (index & register_bit) == 0; }
    uint16_t slot() const { return index & (register_bit - 1); }
};

inline constexpr int max_node_inputs = 4;
inline constexpr int max_instructions = 256;  // of one material

struct Instruction {
    const Node* node = nullptr;
    uint8_t width = 3;  // lanes that count: 1 to 4
    uint32_t data = 0;  // primvar: slot; texture: index; udim: tile set; extract: lane …
    Operand inputs[max_node_inputs];
};

// A UDIM set: tile 1001 + u + 10 v is the unit square at (u, v).
struct TileSet {
    struct Tile {
        uint32_t number, texture;
    };
    std::vector<Tile> tiles;  // by number
};

// A point of a triangle: the barycentrics are (1 − b1 − b2, b1, b2).
struct MeshPoint {
    const Mesh& mesh;
    uint32_t triangle;
    float b1, b2;

    // Interpolates up to four floats of a primvar; returns how many, 0 where the mesh lacks it.
    int primvar(uint32_t slot, float out[4]) const;
    Vec3f position() const;  // in the mesh's own space
    Vec3f normal() const;    // unit, likewise; of the triangle where the mesh has none
};

using Schedule = std::vector<uint16_t>;  // instructions, in the order in which they run

struct Program {
    std::vector<Value> constants;
    std::vector<Instruction> instructions;
    std::vector<TileSet> tile_sets;

    // While building. `node` folds what is constant. Throws std::invalid_argument for an unknown
    // node, a wrong number of inputs, and programs that are too long.
    Operand constant(const Value& value);
    Operand node(const std::string& name, int width, uint32_t data, std::span<const Operand> inputs,
                 const std::vector<Texture>& textures);

    // The instructions that some operands need.
    Schedule schedule(std::span<const Operand> wanted) const;
};

// The values of a program at one point.
class Values {
public:
    Values(const Program& program, const std::vector<Texture>& textures, const MeshPoint& point,
           const Schedule& schedule);

    const Value& operator[](Operand o) const {
        return o.is_constant() ? program_.constants[o.slot()] : registers_[o.slot()];
    }
    Spectrum color(Operand o) const {
        const Value& v = (*this)[o];
        return Spectrum(v[0], v[1], v[2]);
    }
    float number(Operand o) const { return (*this)[o][0]; }

private:
    const Program& program_;
    Value registers_[max_instructions];
};

}  // namespace usdmlt
