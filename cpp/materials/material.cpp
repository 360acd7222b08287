#include "materials/material.hpp"

#include <algorithm>
#include <stdexcept>

#include "materials/closure_builder.hpp"
#include "materials/preview_surface.hpp"

namespace usdmlt {

namespace {

// What an operation takes and leaves; `lobes` is the most it can push.
struct Arity {
    int parameters, operands, lobes;
};

// A scale that is certainly 0, or certainly 1, everywhere.
bool always(const Parameter& p, float value) {
    return p.is_constant() && p.value[0] == value && p.value[1] == value && p.value[2] == value;
}

Arity arity(const Material& material, const Operation& op) {
    switch (op.type) {
        case OperationType::diffuse:
            return {3, 0, 1};
        case OperationType::translucent:
            return {2, 0, 1};
        case OperationType::dielectric:
        case OperationType::conductor:
            return {5, 0, 1};
        case OperationType::schlick:
            return {6, 0, 1};
        case OperationType::emission:
            return {1, 0, 0};
        case OperationType::preview_surface: {
            const Parameter* p = material.parameters.data() + op.parameter;
            return {9, 0, 2 + (always(p[5], 0) ? 0 : 1) + (always(p[7], 1) ? 0 : 1)};
        }
        case OperationType::layer:
        case OperationType::add:
            return {0, 2, 0};
        case OperationType::mix:
            return {1, 2, 0};
        case OperationType::multiply:
            return {1, 1, 0};
    }
    return {};
}

[[noreturn]] void fail(const Material& material, const std::string& what) {
    throw std::invalid_argument("material '" + material.name + "' " + what);
}

void check(const Materials& materials, const Material& material) {
    int operands = 0, lobes = 0;
    for (const Operation& op : material.operations) {
        // A preview surface's arity depends on its parameters: see that they are there first.
        const size_t first = op.parameter, count = material.parameters.size();
        if (first > count || (op.type == OperationType::preview_surface && first + 9 > count) ||
            first + size_t(arity(material, op).parameters) > count)
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
    if (material.reads.size() > size_t(max_texture_reads))
        fail(material, "reads " + std::to_string(material.reads.size()) + " textures; at most " +
                           std::to_string(max_texture_reads) + " are supported");
    for (const TextureRead& read : material.reads)
        if (read.texture >= materials.textures.size())
            fail(material, "reads a texture that is not in the scene");
    const auto check_parameter = [&](const Parameter& p) {
        if (p.source == Parameter::Source::texture && p.index >= material.reads.size())
            fail(material, "has a parameter without its texture");
    };
    std::for_each(material.parameters.begin(), material.parameters.end(), check_parameter);
    check_parameter(material.opacity);
    check_parameter(material.normal);
}

Lobe make_lobe(const Material& material, const Operation& op, ParameterReader& read) {
    const Parameter* p = material.parameters.data() + op.parameter;
    const auto weighted = [&](Lobe& lobe, const Spectrum& color, const Parameter& weight) {
        lobe.coverage = unit_interval(read.number(weight));
        lobe.weight = color * lobe.coverage;
    };
    const auto rough = [&](Lobe& lobe, const Parameter& x, const Parameter& y) {
        lobe.alpha_x = read.number(x);
        lobe.alpha_y = read.number(y);
    };
    Lobe lobe{};
    lobe.reflects = op.reflects;
    lobe.transmits = op.transmits;
    switch (op.type) {
        case OperationType::translucent:
            lobe.type = LobeType::translucent;
            weighted(lobe, read.color(p[0]), p[1]);
            break;
        case OperationType::dielectric:
            lobe.type = LobeType::dielectric;
            lobe.eta = sane_index(read.number(p[0]));
            lobe.is_interface = material.has_interface;
            rough(lobe, p[1], p[2]);
            weighted(lobe, read.color(p[3]), p[4]);
            break;
        case OperationType::conductor:
            lobe.type = LobeType::conductor;
            lobe.color0 = read.color(p[0]);
            lobe.color90 = read.color(p[1]);
            rough(lobe, p[2], p[3]);
            weighted(lobe, Spectrum(1.0f), p[4]);
            break;
        case OperationType::schlick: {
            lobe.type = LobeType::schlick;
            lobe.color0 = read.color(p[0]);
            lobe.color90 = read.color(p[1]);
            lobe.exponent = read.number(p[2]);
            rough(lobe, p[3], p[4]);
            weighted(lobe, Spectrum(1.0f), p[5]);
            // The index whose normal reflectance is the mean of color0.
            const float r = std::sqrt(unit_interval(mean(lobe.color0)));
            lobe.eta = sane_index((1 + r) / std::max(1 - r, 1e-2f));
            break;
        }
        default:
            lobe.type = LobeType::diffuse;
            weighted(lobe, read.color(p[0]), p[1]);
            lobe.alpha_x = read.number(p[2]);
    }
    return lobe;
}

PreviewSurfaceInputs preview_surface_inputs(const Material& material, const Operation& op,
                                            ParameterReader& read) {
    const Parameter* p = material.parameters.data() + op.parameter;
    PreviewSurfaceInputs in;
    in.diffuse_color = non_negative(read.color(p[0]));
    in.emissive_color = read.color(p[1]);
    in.specular_color = read.color(p[2]);
    in.metallic = read.number(p[3]);
    in.roughness = unit_interval(read.number(p[4]));
    in.clearcoat = read.number(p[5]);
    in.clearcoat_roughness = unit_interval(read.number(p[6]));
    in.opacity = read.number(p[7]);
    in.ior = read.number(p[8]);
    in.specular_workflow = op.specular_workflow;
    return in;
}

void run(const Material& material, ParameterReader& read, Closure& closure) {
    ClosureBuilder builder(closure);
    for (const Operation& op : material.operations) {
        const Parameter* p = material.parameters.data() + op.parameter;
        switch (op.type) {
            case OperationType::emission:
                builder.push_emission(read.color(p[0]));
                break;
            case OperationType::preview_surface:
                push_preview_surface(builder, preview_surface_inputs(material, op, read));
                break;
            case OperationType::layer:
                builder.layer();
                break;
            case OperationType::mix:
                builder.mix(read.number(p[0]));
                break;
            case OperationType::add:
                builder.add();
                break;
            case OperationType::multiply:
                builder.multiply(read.color(p[0]));
                break;
            default:
                builder.push_lobe(make_lobe(material, op, read));
        }
    }
    builder.finish();
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

}  // namespace

void finish_material(Materials& materials, uint32_t index) {
    Material& material = materials.materials[index];
    check(materials, material);

    material.has_interface = false;
    bool may_emit = false;
    for (const Operation& op : material.operations) {
        const Parameter* p = material.parameters.data() + op.parameter;
        const bool is_preview = op.type == OperationType::preview_surface;
        material.has_interface |= op.transmits || (is_preview && !always(p[7], 1));
        if (op.type == OperationType::emission) may_emit |= !always(p[0], 0);
        if (is_preview) may_emit |= !always(p[1], 0);
    }

    const auto is_constant = [](const Parameter& p) { return p.is_constant(); };
    material.is_constant =
        std::all_of(material.parameters.begin(), material.parameters.end(), is_constant);
    material.is_emissive = may_emit;
    if (material.is_constant) {
        const Mesh nowhere;
        ParameterReader read(materials.textures, material.reads, {nowhere, 0, 0, 0});
        run(material, read, material.folded);
        material.is_emissive = !is_black(material.folded.emission);
    }

    material.is_opaque =
        material.opacity.is_constant() &&
        (material.opacity_threshold > 0 ? material.opacity.value[0] >= material.opacity_threshold
                                        : material.opacity.value[0] >= 1);
}

void evaluate_material(const Materials& materials, uint32_t index, const Mesh& mesh,
                       uint32_t triangle, float b1, float b2, const Vec3f& dpds, Closure& closure,
                       bool mirrored) {
    const Material& material = materials.materials[index];
    if (material.is_constant && material.tangent_primvar == invalid_index) {
        closure.copy_scattering(material.folded);
        return;
    }
    ParameterReader read(materials.textures, material.reads, {mesh, triangle, b1, b2});
    if (material.is_constant)
        closure.copy_scattering(material.folded);
    else
        run(material, read, closure);
    if (material.tangent_primvar == invalid_index) return;

    closure.shading = Frame::from_normal_and_tangent(closure.shading.z, dpds);
    if (!material.has_normal_map) return;
    // y of the frame is z × x; ∂p/∂t is on the other side where the texture is mirrored.
    const bool flipped =
        (texture_triangle(mesh, triangle, material.tangent_primvar).area < 0) != mirrored;
    const Vec3f normal = mapped_normal(read.color(material.normal), closure.shading, flipped,
                                       closure.geometric_normal);
    closure.shading = Frame::from_normal_and_tangent(normal, dpds);
}

Spectrum emission(const Materials& materials, uint32_t index, const Mesh& mesh, uint32_t triangle,
                  float b1, float b2) {
    const Material& material = materials.materials[index];
    if (material.is_constant) return material.folded.emission;
    if (!material.is_emissive) return Spectrum();
    ParameterReader read(materials.textures, material.reads, {mesh, triangle, b1, b2});
    Spectrum stack[ClosureBuilder::max_operands];
    int count = 0;
    for (const Operation& op : material.operations) {
        const Parameter* p = material.parameters.data() + op.parameter;
        switch (op.type) {
            case OperationType::emission:
                stack[count++] = non_negative(read.color(p[0]));
                break;
            case OperationType::preview_surface:
                stack[count++] = non_negative(read.color(p[1]));
                break;
            case OperationType::mix: {
                const float share = unit_interval(read.number(p[0]));
                --count;
                stack[count - 1] = stack[count - 1] * share + stack[count] * (1 - share);
                break;
            }
            case OperationType::layer:
            case OperationType::add:
                --count;
                stack[count - 1] += stack[count];
                break;
            case OperationType::multiply:
                stack[count - 1] *= non_negative(read.color(p[0]));
                break;
            default:
                stack[count++] = Spectrum();
        }
    }
    return count > 0 ? stack[0] : Spectrum();
}

float opacity(const Materials& materials, uint32_t index, const Mesh& mesh, uint32_t triangle,
              float b1, float b2) {
    const Material& material = materials.materials[index];
    if (material.is_opaque) return 1;
    ParameterReader read(materials.textures, material.reads, {mesh, triangle, b1, b2});
    const float value = read.number(material.opacity);
    if (material.opacity_threshold > 0) return value >= material.opacity_threshold ? 1.0f : 0.0f;
    return unit_interval(value);
}

Vec3f tangent_along_s(const Mesh& mesh, uint32_t triangle, uint32_t slot) {
    const TextureTriangle t = texture_triangle(mesh, triangle, slot);
    if (t.area == 0) return {};
    const Vec3f e1 = mesh.corner(triangle, 1) - mesh.corner(triangle, 0);
    const Vec3f e2 = mesh.corner(triangle, 2) - mesh.corner(triangle, 0);
    const Vec3f dpds = (e1 * t.e2.y - e2 * t.e1.y) / t.area;
    return is_finite(dpds) ? dpds : Vec3f{};
}

}  // namespace usdmlt
