#include "materials/closure.hpp"

#include "materials/directional_albedo.hpp"
#include "materials/layering.hpp"
#include "materials/lobes/diffuse.hpp"
#include "materials/lobes/interface.hpp"
#include "materials/lobes/translucent.hpp"

namespace usdmlt {

namespace {

// ---- One lobe that is not Dirac, in local directions; weight included, layers not.

Spectrum evaluate_lobe(const Lobe& lobe, Vec3f l, Vec3f e) {
    switch (lobe.type) {
        case LobeType::diffuse:
            return diffuse_lobe::evaluate(lobe, l, e);
        case LobeType::translucent:
            return translucent_lobe::evaluate(lobe, l, e);
        default:
            return interface_lobe::evaluate(lobe, l, e);
    }
}

float pdf_lobe(const Lobe& lobe, Vec3f known, Vec3f sampled) {
    switch (lobe.type) {
        case LobeType::diffuse:
            return diffuse_lobe::pdf(known, sampled);
        case LobeType::translucent:
            return translucent_lobe::pdf(known, sampled);
        default:
            return interface_lobe::pdf(lobe, known, sampled);
    }
}

bool sample_lobe(const Lobe& lobe, Vec3f known, float u_lobe, Vec2f u, Vec3f& sampled) {
    switch (lobe.type) {
        case LobeType::diffuse:
            sampled = diffuse_lobe::sample(known, u);
            return true;
        case LobeType::translucent:
            sampled = translucent_lobe::sample(known, u);
            return true;
        default:
            return interface_lobe::sample(lobe, known, u_lobe, u, sampled);
    }
}

// ---- One Dirac lobe. `across`: the directions are on opposite sides.

bool scatters(const Lobe& lobe, bool across) {
    return lobe.delta && (across ? lobe.transmits : lobe.reflects);
}

interface_lobe::Split split_of_pair(const Lobe& lobe, Vec3f a, Vec3f b, bool across) {
    if (!across) return interface_lobe::split(lobe, std::fabs(a.z), a.z > 0);
    return a.z > 0 ? interface_lobe::split_refraction(lobe, a.z, -b.z)
                   : interface_lobe::split_refraction(lobe, b.z, -a.z);
}

float eta_squared(const Lobe& lobe, Vec3f w) {
    return lobe.is_interface && w.z < 0 ? sqr(lobe.eta) : 1.0f;
}

Spectrum evaluate_delta(const Lobe& lobe, Vec3f l, Vec3f e, bool across) {
    const interface_lobe::Split s = split_of_pair(lobe, e, l, across);
    return (across ? s.T : s.R) * eta_squared(lobe, e);
}

float pdf_delta(const Lobe& lobe, Vec3f known, Vec3f sampled, bool across) {
    const interface_lobe::Split s = split_of_pair(lobe, known, sampled, across);
    return (across ? s.P_T : s.P_R) * std::fabs(sampled.z) * eta_squared(lobe, sampled);
}

// ---- All lobes.

bool to_local(const Closure& closure, Vec3f world, Vec3f& local) {
    local = closure.shading.to_local(world);
    return local.z * dot(world, closure.geometric_normal) > 0;
}

// About the share of light from `w` that a lobe scatters, weight included.
float scattering_estimate(const Lobe& lobe, Vec3f w) {
    if (lobe.delta) {
        const interface_lobe::Split s = interface_lobe::split(lobe, std::fabs(w.z), w.z > 0);
        return mean(s.R) + mean(s.T);
    }
    if (lobe.type == LobeType::diffuse || lobe.type == LobeType::translucent)
        return mean(lobe.weight);
    const Spectrum reflected = reflection_albedo(lobe, w);
    Spectrum scattered;
    if (lobe.reflects) scattered += reflected;
    if (lobe.transmits) scattered += lobe.tint_transmission * (Spectrum(1.0f) - reflected);
    // Never so low that rare events of the lobe get a density far below their value.
    return std::max(mean(lobe.weight * scattered), 0.02f * mean(lobe.weight));
}

// Probabilities with which the lobes are chosen, given the known direction.
struct Selection {
    float q[max_lobes];

    Selection(const Closure& closure, Vec3f known, const Passage& of_known) {
        if (closure.lobe_count == 1) {
            q[0] = 1;
            return;
        }
        float sum = 0;
        for (int i = 0; i < closure.lobe_count; ++i) {
            const Lobe& lobe = closure.lobes[i];
            q[i] = scattering_estimate(lobe, known);
            if (lobe.cover != no_cover) q[i] *= mean(of_known.through[lobe.cover]);
            sum += q[i];
        }
        const float scale = sum > 0 ? 1 / sum : 0.0f;
        for (int i = 0; i < closure.lobe_count; ++i) q[i] *= scale;
    }
};

Passage passage_if_covered(const Closure& closure, Vec3f w) {
    return closure.cover_count > 0 ? passage(closure, w) : Passage();
}

Spectrum evaluate_component(const Closure& closure, Vec3f l, const Passage& of_l, Vec3f e,
                            const Passage& of_e, Component component) {
    const auto covered = [&](const Lobe& lobe, const Spectrum& value) {
        return lobe.cover == no_cover ? value : value * coupling(closure, lobe, l, of_l, e, of_e);
    };
    if (component != non_delta) {
        const Lobe& lobe = closure.lobes[lobe_of(component)];
        return covered(lobe, evaluate_delta(lobe, l, e, is_transmission(component)));
    }
    Spectrum sum;
    for (int i = 0; i < closure.lobe_count; ++i) {
        const Lobe& lobe = closure.lobes[i];
        if (!lobe.delta) sum += covered(lobe, evaluate_lobe(lobe, l, e));
    }
    return sum;
}

float pdf_component(const Closure& closure, Vec3f known, Vec3f sampled, const Selection& selection,
                    Component component) {
    if (component != non_delta) {
        const int i = lobe_of(component);
        return selection.q[i] *
               pdf_delta(closure.lobes[i], known, sampled, is_transmission(component));
    }
    float sum = 0;
    for (int i = 0; i < closure.lobe_count; ++i)
        if (!closure.lobes[i].delta && selection.q[i] > 0)
            sum += selection.q[i] * pdf_lobe(closure.lobes[i], known, sampled);
    return sum;
}

// Whether the component can join two local directions at all.
bool joins(const Closure& closure, Vec3f a, Vec3f b, Component component) {
    if (component == non_delta) return true;
    const bool across = a.z * b.z < 0;
    return lobe_of(component) < closure.lobe_count && across == is_transmission(component) &&
           scatters(closure.lobes[lobe_of(component)], across);
}

}  // namespace

Spectrum Closure::evaluate_lobes(Vec3f to_light, Vec3f to_eye, Component component) const {
    Vec3f l, e;
    if (!to_local(*this, to_light, l) || !to_local(*this, to_eye, e)) return Spectrum();
    if (!joins(*this, l, e, component)) return Spectrum();
    return evaluate_component(*this, l, passage_if_covered(*this, l), e,
                              passage_if_covered(*this, e), component);
}

float Closure::pdf_lobes(Vec3f known_world, Vec3f sampled_world, Known, Component component) const {
    Vec3f known, sampled;
    if (!to_local(*this, known_world, known) || !to_local(*this, sampled_world, sampled)) return 0;
    if (!joins(*this, known, sampled, component)) return 0;
    const Selection selection(*this, known, passage_if_covered(*this, known));
    return pdf_component(*this, known, sampled, selection, component);
}

bool Closure::sample_lobes(Vec3f known_world, Known role, float u_lobe, Vec2f u,
                           ClosureSample& out) const {
    Vec3f known, sampled;
    if (!to_local(*this, known_world, known)) return false;
    const Passage of_known = passage_if_covered(*this, known);
    const Selection selection(*this, known, of_known);

    int i = 0;
    while (i < lobe_count && u_lobe >= selection.q[i]) u_lobe -= selection.q[i++];
    if (i >= lobe_count) {  // rounding of the sum, or nothing to choose
        i = lobe_count - 1;
        if (i < 0 || !(selection.q[i] > 0)) return false;
    }
    u_lobe = std::min(u_lobe / selection.q[i], 0x1.fffffep-1f);

    const Lobe& lobe = lobes[i];
    if (lobe.delta) {
        const float side = known.z > 0 ? 1.0f : -1.0f;
        const interface_lobe::Split s = interface_lobe::split(lobe, std::fabs(known.z), side > 0);
        if (u_lobe < s.P_R) {
            sampled = {-known.x, -known.y, known.z};
            out.component = delta_reflection(i);
        } else {
            if (!(s.P_T > 0)) return false;
            sampled = normalize(interface_lobe::refract(
                known, {0, 0, side}, interface_lobe::relative_index(lobe, side > 0)));
            if (!(sampled.z * side < 0)) return false;
            out.component = delta_transmission(i);
        }
    } else {
        if (!sample_lobe(lobe, known, u_lobe, u, sampled)) return false;
        out.component = non_delta;
    }

    out.direction = shading.to_world(sampled);
    if (!(sampled.z * dot(out.direction, geometric_normal) > 0)) return false;
    out.pdf = pdf_component(*this, known, sampled, selection, out.component);
    if (!(out.pdf > 0)) return false;
    const Passage of_sampled = passage_if_covered(*this, sampled);
    out.value =
        role == Known::eye
            ? evaluate_component(*this, sampled, of_sampled, known, of_known, out.component)
            : evaluate_component(*this, known, of_known, sampled, of_sampled, out.component);
    return true;
}

}  // namespace usdmlt
