// Which layers of a film a path belongs to, by light path expressions: what happens to it at its
// vertices, told from the camera to the light, is run through one automaton for all expressions.
//
// A vertex with diffuse and glossy lobes is both at once, each with its share of what is scattered
// from the one direction into the other. The path is divided between the states that it may be in.
#pragma once

#include <cstdint>
#include <vector>

#include "film/layer_sums.hpp"
#include "paths/vertex.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

// See usdmlt/light_path_expressions.py: its order of scatterings and terminals.
struct LightPathAutomaton {
    enum Scattering : uint8_t { RD, RG, RS, TD, TG, TS, volume, scatterings };
    enum Terminal : uint8_t { light, object, background, terminals };
    // What expressions tell lights by: those of one kind have the same names.
    struct Label {
        bool is_object = false;  // a surface that glows, no light
        uint16_t kind = 0;
    };
    int layers = 0, kinds = 1;
    int kind_of_media = 0;         // of what glows in them
    std::vector<uint16_t> next;    // [state][scattering]
    std::vector<LayerMask> masks;  // [state][terminal][kind]
    std::vector<Label> labels;     // of each light

    uint16_t after(uint16_t state, Scattering event) const {
        return next[size_t(state) * scatterings + event];
    }
    LayerMask mask(uint16_t state, Terminal terminal, int kind) const {
        return masks[(size_t(state) * terminals + terminal) * size_t(kinds) + size_t(kind)];
    }
};

// What happens at a vertex: one of two kinds, with `share_of_other` that other.
struct ScatteringEvent {
    LightPathAutomaton::Scattering kind, other;
    Spectrum share_of_other;
    bool mixed = false;
};

ScatteringEvent scattering_event(const Vertex& v, Vec3f to_light, Vec3f to_eye,
                                 Component component);

// Follows one path at a time. Memory of one thread.
class LightPathClasses {
public:
    LightPathClasses(const Scene& scene, const LightPathAutomaton& automaton);

    // The path begins at the camera, goes on to the light, and ends there: with x0, the direction
    // from there to x1 and the path's value, of which the parts are added to `sums`.
    void begin() {
        branches_.assign(1, Branch{0, Spectrum(1.0f)});
        scatterings_ = 0;
    }
    void scatter(const ScatteringEvent& event) {
        step(event, branches_, stepped_);
        std::swap(branches_, stepped_);
        ++scatterings_;
    }
    void end(const Vertex& x0, const Vertex& x1, Vec3f direction, const Spectrum& value,
             LayerSums& sums) const {
        end(branches_, scatterings_, x0, x1, direction, value, sums);
    }
    // A medium glows there.
    void end_in_medium(const Spectrum& value, LayerSums& sums) const {
        end_in(LightPathAutomaton::object, automaton_.kind_of_media, branches_, value, sums);
    }
    void scatter_and_end_in_medium(const ScatteringEvent& event, const Spectrum& value,
                                   LayerSums& sums) {
        step(event, branches_, stepped_);
        end_in(LightPathAutomaton::object, automaton_.kind_of_media, stepped_, value, sums);
    }
    // The same after one more scattering, of which the path that is followed knows nothing.
    void scatter_and_end(const ScatteringEvent& event, const Vertex& x0, const Vertex& x1,
                         Vec3f direction, const Spectrum& value, LayerSums& sums) {
        step(event, branches_, stepped_);
        end(stepped_, scatterings_ + 1, x0, x1, direction, value, sums);
    }

private:
    struct Branch {
        uint16_t state;
        Spectrum share;
    };
    using Branches = std::vector<Branch>;

    void step(const ScatteringEvent& event, const Branches& from, Branches& to) const;
    void end(const Branches& branches, int scatterings, const Vertex& x0, const Vertex& x1,
             Vec3f direction, const Spectrum& value, LayerSums& sums) const;
    void end_in(LightPathAutomaton::Terminal terminal, int kind, const Branches& branches,
                const Spectrum& value, LayerSums& sums) const;

    const Scene& scene_;
    const LightPathAutomaton& automaton_;
    bool environment_is_one_;  // all of its lights are of one kind
    int scatterings_ = 0;
    Branches branches_, stepped_;
};

// What a thread needs to fill a film's layers.
struct LayerScratch {
    LightPathClasses classes;
    LayerSums sample, splat;  // of the sample that is being taken; of one path that lands elsewhere
};

}  // namespace usdmlt
