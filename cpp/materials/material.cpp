#include "materials/material.hpp"

#include <algorithm>
#include <stdexcept>

#include "materials/closure_builder.hpp"
#include "materials/nodes.hpp"

namespace usdmlt {

namespace {

[[noreturn]] void fail(const Material& material, const std::string& what) {
    throw std::invalid_argument("material '" + material.name + "' " + what);
}

void check(const Materials& materials, const Material& material) {
    int operands = 0, lobes = 0;
    for (const Operation& op : material.operations) {
        if (op.parameter + size_t(parameter_count(op.type)) > material.parameters.size())
            fail(material, "has an operation without its parameters");
        const Arity a = arity(material, op);
        if (operands < a.operands) fail(material, "has an operation without its operands");
        operands += a.operands > 0 ? 1 - a.operands : 1;
        lobes += a.lobes;
        // Inside a preview surface up to three operands more are in use for a while.
        if (operands + 3 > ClosureBuilder::max_operands) fail(material, "is nested too deeply");
    }
    if (!material.operations.empty() && operands != 1) fail(material, "is not one closure");
    if (lobes > max_lobes)
        fail(material, "has " + std::to_string(lobes) + " lobes; at most " +
                           std::to_string(max_lobes) + " are supported");
    const auto check_texture = [&](uint32_t texture) {
        if (texture >= materials.textures.size())
            fail(material, "reads a texture that is not in the scene");
    };
    for (const TileSet& set : material.program.tile_sets)
        for (const TileSet::Tile& tile : set.tiles) check_texture(tile.texture);
    for (const Instruction& i : material.program.instructions) {
        if (i.node == find_node("texture")) check_texture(i.data);
        if (i.node == find_node("udim") && i.data >= material.program.tile_sets.size())
            fail(material, "reads a tile set that it does not have");
    }
}

// The tangent-space normal in the frame of the surface: x along ∂p/∂s, y along ∂p/∂t. Where the
// result would point below the geometric surface it is bent back to just above it.
Vec3f mapped_normal(const Spectrum& map, const Frame& frame, bool flipped, Vec3f geometric_normal) {
    const Vec3f n = frame.to_world({map[0], flipped ? -map[1] : map[1], map[2]});
    const float len = length(n);
    if (!(len > 0) || !std::isfinite(len)) return frame.z;
    const Vec3f unit = n / len;
    constexpr float least = 1e-3f;  // cosine to the geometric normal
    const float cosine = dot(unit, geometric_normal);
    if (cosine >= least) return unit;
    return normalize(unit + geometric_normal * (2 * least - cosine));
}

// Twice the signed area of the triangle in texture space, and its edges there.
struct TextureTriangle {
    Vec2f e1, e2;
    float area = 0;
};

TextureTriangle texture_triangle(const Mesh& mesh, uint32_t triangle, uint32_t slot) {
    float st[3][4] = {};
    const float corners[3][2] = {{0, 0}, {1, 0}, {0, 1}};
    for (int i = 0; i < 3; ++i)
        if (MeshPoint{mesh, triangle, corners[i][0], corners[i][1]}.primvar(slot, st[i]) < 2)
            return {};
    TextureTriangle t;
    t.e1 = {st[1][0] - st[0][0], st[1][1] - st[0][1]};
    t.e2 = {st[2][0] - st[0][0], st[2][1] - st[0][1]};
    t.area = t.e1.x * t.e2.y - t.e2.x * t.e1.y;
    return t;
}

// The frame turned about its normal, counter-clockwise.
Frame turned(const Frame& frame, float turns) {
    const float c = std::cos(2 * pi * turns), s = std::sin(2 * pi * turns);
    Frame out = frame;
    out.x = frame.x * c + frame.y * s;
    out.y = frame.y * c - frame.x * s;
    return out;
}

// The operands that the emission depends on: colours of light, and what mixes and scales it.
std::vector<Operand> emission_operands(const Material& material) {
    std::vector<Operand> wanted;
    for (const Operation& op : material.operations) {
        const Operand* p = material.parameters.data() + op.parameter;
        switch (op.type) {
            case OperationType::emission:
            case OperationType::mix:
            case OperationType::multiply:
                wanted.push_back(p[0]);
                break;
            case OperationType::preview_surface:
                wanted.push_back(p[1]);
                break;
            default:
                break;
        }
    }
    return wanted;
}

}  // namespace

void finish_material(Materials& materials, uint32_t index) {
    Material& material = materials.materials[index];
    check(materials, material);

    material.has_interface = false;
    bool may_emit = false;
    for (const Operation& op : material.operations) {
        const Operand* p = material.parameters.data() + op.parameter;
        const bool is_preview = op.type == OperationType::preview_surface;
        material.has_interface |= op.transmits || (is_preview && !always(material, p[7], 1));
        if (op.type == OperationType::emission) may_emit |= !always(material, p[0], 0);
        if (is_preview) may_emit |= !always(material, p[1], 0);
    }
    material.has_interface &= !material.thin_walled;

    std::vector<Operand> scattering = material.parameters;
    if (material.has_normal_map) scattering.push_back(material.normal);
    scattering.push_back(material.tangent_rotation);
    material.scattering_schedule = material.program.schedule(scattering);
    material.emission_schedule = material.program.schedule(emission_operands(material));
    material.opacity_schedule = material.program.schedule({&material.opacity, 1});

    material.is_constant = std::all_of(material.parameters.begin(), material.parameters.end(),
                                       [](Operand o) { return o.is_constant(); });
    material.is_emissive = may_emit;
    if (material.is_constant) {
        const Mesh nowhere;
        run_operations(material,
                       Values(material.program, materials.textures, {nowhere, 0, 0, 0}, {}),
                       material.folded);
        material.is_emissive = !is_black(material.folded.emission);
    }

    material.is_opaque = false;
    if (material.opacity.is_constant()) {
        const float value = material.program.constants[material.opacity.slot()][0];
        material.is_opaque =
            material.opacity_threshold > 0 ? value >= material.opacity_threshold : value >= 1;
    }
}

void evaluate_material(const Materials& materials, uint32_t index, const Mesh& mesh,
                       uint32_t triangle, float b1, float b2, const Vec3f& dpds, Closure& closure,
                       bool mirrored) {
    const Material& material = materials.materials[index];
    if (material.is_constant) closure.copy_scattering(material.folded);
    if (material.is_constant && material.tangent_primvar == invalid_index) return;
    const Values values(material.program, materials.textures, {mesh, triangle, b1, b2},
                        material.scattering_schedule);
    if (!material.is_constant) run_operations(material, values, closure);
    if (material.tangent_primvar == invalid_index) return;

    closure.shading = Frame::from_normal_and_tangent(closure.shading.z, dpds);
    if (material.has_normal_map) {
        // y of the frame is z × x; ∂p/∂t is on the other side where the texture is mirrored.
        const bool flipped =
            (texture_triangle(mesh, triangle, material.tangent_primvar).area < 0) != mirrored;
        const Vec3f normal = mapped_normal(values.color(material.normal), closure.shading, flipped,
                                           closure.geometric_normal);
        closure.shading = Frame::from_normal_and_tangent(normal, dpds);
    }
    const float turns = values.number(material.tangent_rotation);
    if (turns != 0 && std::isfinite(turns)) closure.shading = turned(closure.shading, turns);
}

Spectrum emission(const Materials& materials, uint32_t index, const Mesh& mesh, uint32_t triangle,
                  float b1, float b2) {
    const Material& material = materials.materials[index];
    if (material.is_constant) return material.folded.emission;
    if (!material.is_emissive) return Spectrum();
    return run_emission(material, Values(material.program, materials.textures,
                                         {mesh, triangle, b1, b2}, material.emission_schedule));
}

float opacity(const Materials& materials, uint32_t index, const Mesh& mesh, uint32_t triangle,
              float b1, float b2) {
    const Material& material = materials.materials[index];
    if (material.is_opaque) return 1;
    const Values values(material.program, materials.textures, {mesh, triangle, b1, b2},
                        material.opacity_schedule);
    const float value = values.number(material.opacity);
    if (material.opacity_threshold > 0) return value >= material.opacity_threshold ? 1.0f : 0.0f;
    return unit_interval(value);
}

Vec3f tangent_along_s(const Mesh& mesh, uint32_t triangle, uint32_t slot, float time) {
    const TextureTriangle t = texture_triangle(mesh, triangle, slot);
    if (t.area == 0) return {};
    const Vec3f origin = mesh.corner(triangle, 0, time);
    const Vec3f e1 = mesh.corner(triangle, 1, time) - origin;
    const Vec3f e2 = mesh.corner(triangle, 2, time) - origin;
    const Vec3f dpds = (e1 * t.e2.y - e2 * t.e1.y) / t.area;
    return is_finite(dpds) ? dpds : Vec3f{};
}

}  // namespace usdmlt
