#include "paths/light_path_classes.hpp"

#include <algorithm>

namespace usdmlt {

ScatteringEvent scattering_event(const Vertex& v, Vec3f to_light, Vec3f to_eye,
                                 Component component) {
    using Automaton = LightPathAutomaton;
    if (v.is_medium()) return {Automaton::volume, {}, {}};
    if (component != non_delta)
        return {is_transmission(component) ? Automaton::TS : Automaton::RS, {}, {}};
    const Closure& closure = v.closure;
    const bool across = dot(to_light, v.normal) * dot(to_eye, v.normal) < 0;
    const auto diffuse = across ? Automaton::TD : Automaton::RD;
    const auto glossy = across ? Automaton::TG : Automaton::RG;
    bool has_diffuse = false, has_glossy = false;
    for (int i = 0; i < closure.lobe_count; ++i) {
        if (closure.lobes[i].delta) continue;
        (is_diffuse(closure.lobes[i].type) ? has_diffuse : has_glossy) = true;
    }
    if (!has_glossy) return {diffuse, {}, {}};
    if (!has_diffuse) return {glossy, {}, {}};
    const Spectrum all = closure.evaluate(to_light, to_eye);
    const Spectrum part = closure.evaluate_diffuse(to_light, to_eye);
    ScatteringEvent event{glossy, diffuse, {}, true};
    for (int c = 0; c < 3; ++c)
        event.share_of_other[c] = all[c] > 0 ? std::clamp(part[c] / all[c], 0.0f, 1.0f) : 0;
    return event;
}

LightPathClasses::LightPathClasses(const Scene& scene, const LightPathAutomaton& automaton)
    : scene_(scene), automaton_(automaton) {
    const std::vector<uint32_t>& environment = scene.lights.environment;
    environment_is_one_ = std::all_of(environment.begin(), environment.end(), [&](uint32_t light) {
        return automaton.labels[light].kind == automaton.labels[environment[0]].kind;
    });
    const size_t states = automaton.next.size() / LightPathAutomaton::scatterings;
    branches_.reserve(states);
    stepped_.reserve(states);
}

void LightPathClasses::step(const ScatteringEvent& event, const Branches& from,
                            Branches& to) const {
    to.clear();
    const auto go = [&](uint16_t state, const Spectrum& share) {
        for (Branch& branch : to)
            if (branch.state == state) {
                branch.share += share;
                return;
            }
        to.push_back({state, share});
    };
    for (const Branch& branch : from) {
        const uint16_t state = automaton_.after(branch.state, event.kind);
        if (!event.mixed) {
            go(state, branch.share);
            continue;
        }
        const Spectrum other = branch.share * event.share_of_other;
        go(state, branch.share - other);
        go(automaton_.after(branch.state, event.other), other);
    }
}

void LightPathClasses::end_in(LightPathAutomaton::Terminal terminal, int kind,
                              const Branches& branches, const Spectrum& value,
                              LayerSums& sums) const {
    for (const Branch& branch : branches)
        sums.add(automaton_.mask(branch.state, terminal, kind), value * branch.share);
}

void LightPathClasses::end(const Branches& branches, int scatterings, const Vertex& x0,
                           const Vertex& x1, Vec3f direction, const Spectrum& value,
                           LayerSums& sums) const {
    using Automaton = LightPathAutomaton;
    const Lights& lights = scene_.lights;
    if (x0.light.light != environment_light) {
        const Automaton::Label label = automaton_.labels[x0.light.light];
        return end_in(label.is_object ? Automaton::object : Automaton::light, label.kind, branches,
                      value, sums);
    }
    const auto terminal = scatterings == 0 ? Automaton::background : Automaton::light;
    if (environment_is_one_)
        return end_in(terminal, automaton_.labels[lights.environment[0]].kind, branches, value,
                      sums);
    // The environment is the sum of its lights.
    const uint32_t receiver = x1.is_surface() ? scene_.receiver_of(x1.mesh) : every_receiver;
    const Spectrum all = radiance(lights, x0.light, direction, receiver);
    for (const uint32_t light : lights.environment) {
        Spectrum part = environment_radiance(lights, light, x0.light, receiver);
        for (int c = 0; c < 3; ++c) part[c] = all[c] != 0 ? value[c] * part[c] / all[c] : 0;
        end_in(terminal, automaton_.labels[light].kind, branches, part, sums);
    }
}

}  // namespace usdmlt
