#include "materials/operations.hpp"

#include <cmath>

#include "materials/closure_builder.hpp"
#include "materials/fresnel.hpp"
#include "materials/material.hpp"
#include "materials/preview_surface.hpp"

namespace usdmlt {

int parameter_count(OperationType type) {
    switch (type) {
        case OperationType::diffuse:
        case OperationType::eon:
        case OperationType::sheen:
            return 3;
        case OperationType::translucent:
            return 2;
        case OperationType::conductor:
            return 5;
        case OperationType::dielectric:
        case OperationType::schlick:
            return 7;
        case OperationType::preview_surface:
            return 9;
        case OperationType::emission:
        case OperationType::mix:
        case OperationType::multiply:
            return 1;
        case OperationType::layer:
        case OperationType::add:
            return 0;
    }
    return 0;
}

Arity arity(const Material& material, const Operation& op) {
    const int parameters = parameter_count(op.type);
    switch (op.type) {
        case OperationType::emission:
            return {parameters, 0, 0};
        case OperationType::preview_surface: {
            const Operand* p = material.parameters.data() + op.parameter;
            return {parameters, 0,
                    2 + (always(material, p[5], 0) ? 0 : 1) + (always(material, p[7], 1) ? 0 : 1)};
        }
        case OperationType::layer:
        case OperationType::mix:
        case OperationType::add:
            return {parameters, 2, 0};
        case OperationType::multiply:
            return {parameters, 1, 0};
        default:
            return {parameters, 0, 1};
    }
}

bool always(const Material& material, Operand o, float value) {
    if (!o.is_constant()) return false;
    const Value& v = material.program.constants[o.slot()];
    return v[0] == value && v[1] == value && v[2] == value;
}

namespace {

Lobe make_lobe(const Material& material, const Operation& op, const Values& values) {
    const Operand* p = material.parameters.data() + op.parameter;
    const auto weighted = [&](Lobe& lobe, const Spectrum& color, Operand weight) {
        lobe.coverage = unit_interval(values.number(weight));
        lobe.weight = color * lobe.coverage;
    };
    const auto rough = [&](Lobe& lobe, Operand x, Operand y) {
        lobe.alpha_x = values.number(x);
        lobe.alpha_y = values.number(y);
    };
    Lobe lobe{};
    lobe.reflects = op.reflects;
    lobe.transmits = op.transmits;
    switch (op.type) {
        case OperationType::translucent:
            lobe.type = LobeType::translucent;
            weighted(lobe, values.color(p[0]), p[1]);
            break;
        case OperationType::dielectric:
            lobe.type = LobeType::dielectric;
            lobe.eta = sane_index(values.number(p[0]));
            lobe.is_interface = material.has_interface;
            rough(lobe, p[1], p[2]);
            weighted(lobe, values.color(p[3]), p[6]);
            lobe.color0 = values.color(p[4]);
            lobe.tint_transmission = values.color(p[5]);
            break;
        case OperationType::conductor:
            lobe.type = LobeType::conductor;
            lobe.color0 = values.color(p[0]);
            lobe.color90 = values.color(p[1]);
            rough(lobe, p[2], p[3]);
            weighted(lobe, Spectrum(1.0f), p[4]);
            break;
        case OperationType::schlick: {
            lobe.type = LobeType::schlick;
            lobe.color0 = values.color(p[0]);
            lobe.color90 = values.color(p[2]);
            lobe.exponent = values.number(p[3]);
            if (!always(material, p[1], 1))
                lobe.edge =
                    schlick_edge(lobe.color0, lobe.color90, lobe.exponent, values.color(p[1]));
            rough(lobe, p[4], p[5]);
            weighted(lobe, Spectrum(1.0f), p[6]);
            // The index whose normal reflectance is the mean of color0.
            const float r = std::sqrt(unit_interval(mean(lobe.color0)));
            lobe.eta = sane_index((1 + r) / std::max(1 - r, 1e-2f));
            break;
        }
        case OperationType::sheen:
            lobe.type = LobeType::sheen;
            weighted(lobe, values.color(p[0]), p[1]);
            lobe.alpha_x = values.number(p[2]);
            break;
        case OperationType::eon:
            lobe.type = LobeType::eon;
            lobe.color0 = values.color(p[0]);
            weighted(lobe, Spectrum(1.0f), p[1]);
            lobe.alpha_x = values.number(p[2]);
            break;
        default:
            lobe.type = LobeType::diffuse;
            weighted(lobe, values.color(p[0]), p[1]);
            lobe.alpha_x = values.number(p[2]);
    }
    return lobe;
}

PreviewSurfaceInputs preview_surface_inputs(const Material& material, const Operation& op,
                                            const Values& values) {
    const Operand* p = material.parameters.data() + op.parameter;
    PreviewSurfaceInputs in;
    in.diffuse_color = non_negative(values.color(p[0]));
    in.emissive_color = values.color(p[1]);
    in.specular_color = values.color(p[2]);
    in.metallic = values.number(p[3]);
    in.roughness = unit_interval(values.number(p[4]));
    in.clearcoat = values.number(p[5]);
    in.clearcoat_roughness = unit_interval(values.number(p[6]));
    in.opacity = values.number(p[7]);
    in.ior = values.number(p[8]);
    in.specular_workflow = op.specular_workflow;
    return in;
}

}  // namespace

void run_operations(const Material& material, const Values& values, Closure& closure) {
    ClosureBuilder builder(closure);
    for (const Operation& op : material.operations) {
        const Operand* p = material.parameters.data() + op.parameter;
        switch (op.type) {
            case OperationType::emission:
                builder.push_emission(values.color(p[0]));
                break;
            case OperationType::preview_surface:
                push_preview_surface(builder, preview_surface_inputs(material, op, values));
                break;
            case OperationType::layer:
                builder.layer();
                break;
            case OperationType::mix:
                builder.mix(values.number(p[0]));
                break;
            case OperationType::add:
                builder.add();
                break;
            case OperationType::multiply:
                builder.multiply(values.color(p[0]));
                break;
            default:
                builder.push_lobe(make_lobe(material, op, values));
        }
    }
    builder.finish();
}

Spectrum run_emission(const Material& material, const Values& values) {
    Spectrum stack[ClosureBuilder::max_operands];
    int count = 0;
    for (const Operation& op : material.operations) {
        const Operand* p = material.parameters.data() + op.parameter;
        switch (op.type) {
            case OperationType::emission:
                stack[count++] = non_negative(values.color(p[0]));
                break;
            case OperationType::preview_surface:
                stack[count++] = non_negative(values.color(p[1]));
                break;
            case OperationType::mix: {
                const float share = unit_interval(values.number(p[0]));
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
                stack[count - 1] *= non_negative(values.color(p[0]));
                break;
            default:
                stack[count++] = Spectrum();
        }
    }
    return count > 0 ? stack[0] : Spectrum();
}

}  // namespace usdmlt
