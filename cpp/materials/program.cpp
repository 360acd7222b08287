#include "materials/program.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "materials/nodes.hpp"

namespace usdmlt {

namespace {

Value run(const Instruction& i, const Value in[], const Program& program,
          const std::vector<Texture>& textures, const MeshPoint& point) {
    return i.node->evaluate(in, {program, textures, point, i.width, i.data});
}

// Three values at the corners, interpolated.
Vec3f interpolate(const MeshPoint& p, Vec3f a, Vec3f b, Vec3f c) {
    return a + (b - a) * p.b1 + (c - a) * p.b2;
}

}  // namespace

int MeshPoint::primvar(uint32_t slot, float out[4]) const {
    if (slot >= mesh.primvars.size() || mesh.primvars[slot].empty()) return 0;
    const CornerValues& values = mesh.primvars[slot];
    const Triangle& vertices = mesh.triangles[triangle];
    const float *v0 = values.at(vertices, triangle, 0), *v1 = values.at(vertices, triangle, 1),
                *v2 = values.at(vertices, triangle, 2);
    for (int i = 0; i < values.width; ++i)
        out[i] = v0[i] + b1 * (v1[i] - v0[i]) + b2 * (v2[i] - v0[i]);
    return values.width;
}

Vec3f MeshPoint::position() const {
    return interpolate(*this, mesh.corner(triangle, 0), mesh.corner(triangle, 1),
                       mesh.corner(triangle, 2));
}

Vec3f MeshPoint::normal() const {
    const Vec3f a = mesh.corner(triangle, 0);
    Vec3f n = cross(mesh.corner(triangle, 1) - a, mesh.corner(triangle, 2) - a);
    if (!mesh.normals.empty()) {
        const auto corner = [&](int i) {
            const float* v = mesh.normals.at(mesh.triangles[triangle], triangle, i);
            return Vec3f{v[0], v[1], v[2]};
        };
        n = interpolate(*this, corner(0), corner(1), corner(2));
    }
    const float len = length(n);
    return len > 0 ? n / len : Vec3f{0, 0, 1};
}

Operand Program::constant(const Value& value) {
    const auto same = std::find_if(constants.begin(), constants.end(), [&](const Value& v) {
        return std::memcmp(&v, &value, sizeof(Value)) == 0;
    });
    const auto index = static_cast<size_t>(same - constants.begin());
    if (same == constants.end()) {
        if (index >= Operand::register_bit) throw std::invalid_argument("has too many constants");
        constants.push_back(value);
    }
    return {static_cast<uint16_t>(index)};
}

Operand Program::node(const std::string& name, int width, uint32_t data,
                      std::span<const Operand> inputs, const std::vector<Texture>& textures) {
    Instruction instruction;
    instruction.node = find_node(name);
    if (!instruction.node) throw std::invalid_argument("has a node of unknown kind '" + name + "'");
    if (int(inputs.size()) != instruction.node->inputs)
        throw std::invalid_argument("has a node '" + name + "' with " +
                                    std::to_string(inputs.size()) + " inputs");
    instruction.width = static_cast<uint8_t>(std::clamp(width, 1, 4));
    instruction.data = data;
    std::copy(inputs.begin(), inputs.end(), instruction.inputs);

    if (!instruction.node->varies &&
        std::all_of(inputs.begin(), inputs.end(), [](Operand o) { return o.is_constant(); })) {
        const Mesh nowhere;
        Value in[max_node_inputs] = {};
        for (size_t k = 0; k < inputs.size(); ++k) in[k] = constants[inputs[k].slot()];
        return constant(run(instruction, in, *this, textures, {nowhere, 0, 0, 0}));
    }
    if (instructions.size() >= size_t(max_instructions))
        throw std::invalid_argument("has more than " + std::to_string(max_instructions) +
                                    " pattern nodes");
    instructions.push_back(instruction);
    return {static_cast<uint16_t>((instructions.size() - 1) | Operand::register_bit)};
}

Schedule Program::schedule(std::span<const Operand> wanted) const {
    std::vector<bool> needed(instructions.size());
    for (const Operand o : wanted)
        if (!o.is_constant()) needed[o.slot()] = true;
    for (size_t i = instructions.size(); i-- > 0;)
        if (needed[i])
            for (int k = 0; k < instructions[i].node->inputs; ++k)
                if (const Operand o = instructions[i].inputs[k]; !o.is_constant())
                    needed[o.slot()] = true;
    Schedule order;
    for (size_t i = 0; i < needed.size(); ++i)
        if (needed[i]) order.push_back(static_cast<uint16_t>(i));
    return order;
}

Values::Values(const Program& program, const std::vector<Texture>& textures, const MeshPoint& point,
               const Schedule& schedule)
    : program_(program) {
    Value in[max_node_inputs];
    for (const uint16_t i : schedule) {
        const Instruction& instruction = program.instructions[i];
        for (int k = 0; k < instruction.node->inputs; ++k) in[k] = (*this)[instruction.inputs[k]];
        registers_[i] = run(instruction, in, program, textures, point);
    }
}

}  // namespace usdmlt
