#include "materials/closure.hpp"

#include "materials/directional_albedo.hpp"
#include "materials/layering.hpp"
#include "materials/lobes/diffuse.hpp"
#include "materials/lobes/eon.hpp"
#include "materials/lobes/interface.hpp"
#include "materials/lobes/sheen.hpp"
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
        case LobeType::eon:
            return eon_lobe::evaluate(lobe, l, e);
        case LobeType::sheen:
            return sheen_lobe::evaluate(lobe, l, e);
        default:
            return interface_lobe::evaluate(lobe, l, e);
    }
}

float pdf_lobe(const Lobe& lobe, Vec3f known, Vec3f sampled) {
    switch (lobe.type) {
        case LobeType::diffuse:
        case LobeType::eon:
            return diffuse_lobe::pdf(known, sampled);
        case LobeType::translucent:
            return translucent_lobe::pdf(known, sampled);
        case LobeType::sheen:
            return sheen_lobe::pdf(known, sampled);
        default:
            return interface_lobe::pdf(lobe, known, sampled);
    }
}

// Both at once, which is less work for microfacets.
struct ValueAndPdf {
    Spectrum value;
    float pdf = 0;
};

ValueAndPdf scatter_lobe(const Lobe& lobe, Vec3f known, Vec3f sampled, Known role) {
    const Vec3f l = role == Known::eye ? sampled : known, e = role == Known::eye ? known : sampled;
    if (is_diffuse(lobe.type) || lobe.type == LobeType::sheen)
        return {evaluate_lobe(lobe, l, e), pdf_lobe(lobe, known, sampled)};
    const interface_lobe::Pair pair = interface_lobe::join(lobe, known, sampled);
    if (!pair.joined) return {};
    return {interface_lobe::value(lobe, pair, l, e),
            interface_lobe::density(lobe, pair, known, sampled)};
}

bool sample_lobe(const Lobe& lobe, Vec3f known, float u_lobe, Vec2f u, Vec3f& sampled) {
    switch (lobe.type) {
        case LobeType::diffuse:
        case LobeType::eon:
            sampled = diffuse_lobe::sample(known, u);
            return true;
        case LobeType::translucent:
            sampled = translucent_lobe::sample(known, u);
            return true;
        case LobeType::sheen:
            sampled = sheen_lobe::sample(known, u);
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

ValueAndPdf scatter_delta(const Lobe& lobe, Vec3f known, Vec3f sampled, Known role, bool across) {
    const interface_lobe::Split s = split_of_pair(lobe, known, sampled, across);
    const float eta2_sampled = eta_squared(lobe, sampled);
    const float eta2_eye = role == Known::eye ? eta_squared(lobe, known) : eta2_sampled;
    return {(across ? s.T : s.R) * eta2_eye,
            (across ? s.P_T : s.P_R) * std::fabs(sampled.z) * eta2_sampled};
}

bool sample_delta(int i, const Lobe& lobe, Vec3f known, float u_lobe, Vec3f& sampled,
                  Component& component) {
    const float side = known.z > 0 ? 1.0f : -1.0f;
    const interface_lobe::Split s = interface_lobe::split(lobe, std::fabs(known.z), side > 0);
    if (u_lobe < s.P_R) {
        sampled = {-known.x, -known.y, known.z};
        component = delta_reflection(i);
        return true;
    }
    if (!(s.P_T > 0)) return false;
    const float m = interface_lobe::relative_index(lobe, side > 0);
    sampled = normalize(interface_lobe::refract(known, {0, 0, side}, m, s.cos_t));
    component = delta_transmission(i);
    return sampled.z * side < 0;
}

// ---- All lobes.

bool to_local(const Closure& closure, Vec3f world, Vec3f& local) {
    local = closure.shading.to_local(world);
    return local.z * dot(world, closure.geometric_normal) > 0;
}

Spectrum covered(const Closure& closure, const Lobe& lobe, const Spectrum& value, Vec3f l,
                 const Passage& of_l, Vec3f e, const Passage& of_e) {
    return lobe.cover == no_cover ? value : value * coupling(closure, lobe, l, of_l, e, of_e);
}

// About the share of light from `w` that lobe i, not a Dirac one, scatters, weight included.
Spectrum scattered_share(const Closure& closure, int i, Vec3f w, const Passage& of_w) {
    const Lobe& lobe = closure.lobes[i];
    if (lobe.type == LobeType::eon) return lobe.weight * lobe.color0;
    if (is_diffuse(lobe.type)) return lobe.weight;
    const Spectrum reflected =
        of_w.has_albedo >> i & 1 ? of_w.albedo[i] : reflection_albedo(lobe, w);
    Spectrum scattered;
    if (lobe.reflects)
        scattered += lobe.type == LobeType::dielectric ? lobe.color0 * reflected : reflected;
    if (lobe.transmits) scattered += lobe.tint_transmission * (Spectrum(1.0f) - reflected);
    return lobe.weight * scattered;
}

// What lobes are chosen by.
float scattering_estimate(const Closure& closure, int i, Vec3f w, const Passage& of_w) {
    const Lobe& lobe = closure.lobes[i];
    if (lobe.delta) {
        const interface_lobe::Split s = interface_lobe::split(lobe, std::fabs(w.z), w.z > 0);
        return mean(s.R) + mean(s.T);
    }
    const float share = mean(scattered_share(closure, i, w, of_w));
    // Never so low that rare events of the lobe get a density far below their value.
    return is_diffuse(lobe.type) ? share : std::max(share, 0.02f * mean(lobe.weight));
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
            q[i] = scattering_estimate(closure, i, known, of_known);
            if (lobe.cover != no_cover) q[i] *= mean(of_known.through[lobe.cover]);
            sum += q[i];
        }
        const float scale = sum > 0 ? 1 / sum : 0.0f;
        for (int i = 0; i < closure.lobe_count; ++i) q[i] *= scale;
    }

    // The lobe of a uniform number, which becomes its place in that lobe's interval; −1 if none.
    int choose(int count, float& u) const {
        int i = 0;
        while (i < count && u >= q[i]) u -= q[i++];
        if (i == count) --i;  // the probabilities sum to 1 but for rounding
        if (i < 0 || !(q[i] > 0)) return -1;
        u = std::min(u / q[i], 0x1.fffffep-1f);
        return i;
    }
};

// Whether the component can join two local directions at all.
bool joins(const Closure& closure, Vec3f a, Vec3f b, Component component) {
    if (component == non_delta) return true;
    const bool across = a.z * b.z < 0;
    return lobe_of(component) < closure.lobe_count && across == is_transmission(component) &&
           scatters(closure.lobes[lobe_of(component)], across);
}

}  // namespace

Spectrum Closure::evaluate_lobes(Vec3f to_light, Vec3f to_eye, Component component) const {
    if (is_phase) [[unlikely]]
        return component == non_delta ? lobes[0].weight * phase(to_light, to_eye) : Spectrum();
    Vec3f l, e;
    if (!to_local(*this, to_light, l) || !to_local(*this, to_eye, e)) return Spectrum();
    if (!joins(*this, l, e, component)) return Spectrum();
    const Passage of_l(*this, l), of_e(*this, e);
    if (component != non_delta) {
        const Lobe& lobe = lobes[lobe_of(component)];
        const bool across = is_transmission(component);
        const Spectrum value = scatter_delta(lobe, e, l, Known::eye, across).value;
        return covered(*this, lobe, value, l, of_l, e, of_e);
    }
    Spectrum sum;
    for (int i = 0; i < lobe_count; ++i)
        if (!lobes[i].delta)
            sum += covered(*this, lobes[i], evaluate_lobe(lobes[i], l, e), l, of_l, e, of_e);
    return sum;
}

Spectrum Closure::evaluate_diffuse(Vec3f to_light, Vec3f to_eye) const {
    Vec3f l, e;
    if (!to_local(*this, to_light, l) || !to_local(*this, to_eye, e)) return Spectrum();
    const Passage of_l(*this, l), of_e(*this, e);
    Spectrum sum;
    for (int i = 0; i < lobe_count; ++i)
        if (is_diffuse(lobes[i].type))
            sum += covered(*this, lobes[i], evaluate_lobe(lobes[i], l, e), l, of_l, e, of_e);
    return sum;
}

Spectrum Closure::albedo(Vec3f to_eye) const {
    Vec3f e;
    if (!to_local(*this, to_eye, e)) return Spectrum();
    const Passage of_e(*this, e);
    Spectrum sum;
    for (int i = 0; i < lobe_count; ++i) {
        const Lobe& lobe = lobes[i];
        Spectrum share;
        if (lobe.delta) {
            const interface_lobe::Split s = interface_lobe::split(lobe, std::fabs(e.z), e.z > 0);
            share = s.R + s.T;
        } else {
            share = scattered_share(*this, i, e, of_e);
        }
        sum += lobe.cover == no_cover ? share : share * of_e.through[lobe.cover];
    }
    return sum;
}

float Closure::pdf_lobes(Vec3f known_world, Vec3f sampled_world, Known role,
                         Component component) const {
    if (is_phase) [[unlikely]]
        return component == non_delta ? phase(known_world, sampled_world) : 0;
    Vec3f known, sampled;
    if (!to_local(*this, known_world, known) || !to_local(*this, sampled_world, sampled)) return 0;
    if (!joins(*this, known, sampled, component)) return 0;
    const Selection selection(*this, known, Passage(*this, known));
    if (component != non_delta) {
        const int i = lobe_of(component);
        return selection.q[i] *
               scatter_delta(lobes[i], known, sampled, role, is_transmission(component)).pdf;
    }
    float sum = 0;
    for (int i = 0; i < lobe_count; ++i)
        if (!lobes[i].delta && selection.q[i] > 0)
            sum += selection.q[i] * pdf_lobe(lobes[i], known, sampled);
    return sum;
}

bool Closure::sample_lobes(Vec3f known_world, Known role, float u_lobe, Vec2f u,
                           ClosureSample& out) const {
    if (is_phase) [[unlikely]] {
        out.direction = phase.sample(known_world, u);
        out.pdf = phase(known_world, out.direction);
        out.value = lobes[0].weight * out.pdf;
        out.component = non_delta;
        return out.pdf > 0;
    }
    Vec3f known, sampled;
    if (!to_local(*this, known_world, known)) return false;
    const Passage of_known(*this, known);
    const Selection selection(*this, known, of_known);
    const int i = selection.choose(lobe_count, u_lobe);
    if (i < 0) return false;

    const bool found = lobes[i].delta
                           ? sample_delta(i, lobes[i], known, u_lobe, sampled, out.component)
                           : sample_lobe(lobes[i], known, u_lobe, u, sampled);
    if (!found) return false;
    if (!lobes[i].delta) out.component = non_delta;
    out.direction = shading.to_world(sampled);
    if (!(sampled.z * dot(out.direction, geometric_normal) > 0)) return false;

    const Passage of_sampled(*this, sampled);
    out.value = Spectrum();
    out.pdf = 0;
    for (int k = 0; k < lobe_count; ++k) {
        const Lobe& lobe = lobes[k];
        ValueAndPdf part;
        if (out.component == non_delta) {
            if (lobe.delta) continue;
            part = scatter_lobe(lobe, known, sampled, role);
        } else {
            if (k != i) continue;
            part = scatter_delta(lobe, known, sampled, role, is_transmission(out.component));
        }
        // Layers treat both directions alike.
        out.value += covered(*this, lobe, part.value, known, of_known, sampled, of_sampled);
        out.pdf += selection.q[k] * part.pdf;
    }
    return out.pdf > 0;
}

// Mixture of guide and closure; Dirac components are left to the closure.
float Closure::pdf_guided(Vec3f known, Vec3f sampled, Component component) const {
    constexpr float share = DirectionGuide::share;
    const float own = (1 - share) * pdf_scattering(known, sampled, Known::eye, component);
    return component == non_delta ? own + share * guide->pdf(sampled) : own;
}

bool Closure::sample_guided(Vec3f known, float u_lobe, Vec2f u, ClosureSample& out) const {
    constexpr float share = DirectionGuide::share;
    if (u_lobe < share) {
        out.direction = guide->sample(u_lobe / share, u);
        out.component = non_delta;
        out.value = evaluate(out.direction, known);
        if (is_black(out.value)) return false;
    } else if (!sample_scattering(known, Known::eye, (u_lobe - share) / (1 - share), u, out)) {
        return false;
    }
    if (out.component == non_delta)
        out.pdf = pdf_guided(known, out.direction, non_delta);
    else
        out.pdf *= 1 - share;
    return out.pdf > 0;
}

bool Closure::delta_direction(Vec3f known_world, Component component, Vec3f& sampled_world) const {
    const int i = lobe_of(component);
    const bool across = is_transmission(component);
    Vec3f known;
    if (i >= lobe_count || !scatters(lobes[i], across) || !to_local(*this, known_world, known))
        return false;
    Vec3f sampled{-known.x, -known.y, known.z};
    if (across) {
        const float side = known.z > 0 ? 1.0f : -1.0f;
        const interface_lobe::Split s =
            interface_lobe::split(lobes[i], std::fabs(known.z), side > 0);
        if (!(s.P_T > 0)) return false;  // total reflection
        const float m = interface_lobe::relative_index(lobes[i], side > 0);
        sampled = normalize(interface_lobe::refract(known, {0, 0, side}, m, s.cos_t));
        if (!(sampled.z * side < 0)) return false;
    }
    sampled_world = shading.to_world(sampled);
    return sampled.z * dot(sampled_world, geometric_normal) > 0;
}

}  // namespace usdmlt
