// The target of Metropolis light transport: f*(x) = w(raster) · Σ_c w_c |f_c(x)| over paths, and
// what a path deposits.
#pragma once

#include "film/film.hpp"
#include "film/pixel_filter.hpp"
#include "integrators/importance_map.hpp"
#include "integrators/path_classes.hpp"
#include "integrators/pilot_notes.hpp"
#include "mutations/mutations.hpp"

namespace usdmlt {

// Weights of the channels in f*: near those of luminance, and all of them positive, so that f* is
// where f is.
inline constexpr double target_weights[3] = {0.25, 0.65, 0.10};

struct PathState {
    Path path;
    ScaledDouble target;  // f*
    Spectrum color;       // f / f*
};

// What paths are recorded into: a film, or a pilot's notes, or nothing.
struct PathRecorder {
    PilotNotes* pilot = nullptr;
    Film* film = nullptr;
    const PixelFilter* filter = nullptr;
    float reduction = 1;  // see Settings
    PathClasses* classes = nullptr;
    double scale = 1;  // b of the unit
    int batch = 0;
};

class PathTarget {
public:
    using State = PathState;

    PathTarget(MutationContext& context, const ImportanceMap& importance, bool background)
        : context_(context), importance_(importance), background_(background) {}

    PathRecorder recorder;

    uint32_t applicable(const State& x) const {
        return applicable_mutations(context_, x.path) & enabled_;
    }
    // Mutations that may be selected.
    void enable(uint32_t mask) { enabled_ = mask; }

    bool propose(int m, const State& x, State& y);
    double ratio(int m, const State& x, const State& y);
    void deposit(const State& state, double weight);
    void accept(State& x, State& y) {
        context_.arena.give(x.path, change_.l + 1, change_.m);
        std::swap(x, y);
    }
    void reject(const State& y) { context_.arena.give(y.path, change_.l + 1, change_.m_y); }

    // f* and colour of a path whose factors are all made; false where f* is not positive.
    bool evaluate(State& state);

    uint64_t non_finite() const { return non_finite_; }

    const Change& change() const { return change_; }

private:
    bool finish(State& y);

    MutationContext& context_;
    const ImportanceMap& importance_;
    bool background_;
    uint32_t enabled_ = ~0u;
    Change change_;
    uint64_t non_finite_ = 0;  // proposals whose contribution is none
};

}  // namespace usdmlt
