// The target of Metropolis light transport: f*(x) = w(raster) · Σ_c w_c |f_c(x)| over paths, and
// what a path deposits.
#pragma once

#include <array>

#include "film/film.hpp"
#include "film/pixel_filter.hpp"
#include "integrators/importance_map.hpp"
#include "integrators/path_classes.hpp"
#include "integrators/pilot_notes.hpp"
#include "integrators/split.hpp"
#include "integrators/spread.hpp"
#include "mutations/mutations.hpp"
#include "paths/light_path_classes.hpp"

namespace usdmlt {

// Weights of the channels in f*: near those of luminance, and all of them positive, so that f* is
// where f is.
inline constexpr double target_weights[3] = {0.25, 0.65, 0.10};

struct PathState {
    Path path;
    ScaledDouble target;  // f*
    Spectrum color;       // f / f*
    int band = 0;         // see Spread
};

// What paths are recorded into: a film, or a pilot's notes, or nothing.
struct PathRecorder {
    PilotNotes* pilot = nullptr;
    Film* film = nullptr;
    const PixelFilter* filter = nullptr;
    float reduction = 1;  // see Settings
    PathClasses* classes = nullptr;
    double scale = 1;                // of the chains: b of the unit
    UnitSplats* unit = nullptr;      // of the film
    LayerScratch* layers = nullptr;  // null: the film has none

    // A path of one class that lands at `raster`; its parts are in layers->splat.
    void splat(Vec2f raster, const Spectrum& value, uint64_t path_class,
               RandomStream& random) const {
        Vec2f offset;
        if (filter->kind != PixelFilter::Kind::box) offset = filter->offset(random.next_2d());
        const float x = std::floor((raster.x - offset.x) / reduction);
        const float y = std::floor((raster.y - offset.y) / reduction);
        if (!(x >= 0 && y >= 0 && x < float(film->width()) && y < float(film->height()))) return;
        film->add_splat(static_cast<int>(x), static_cast<int>(y), value, *unit,
                        layers ? &layers->splat : nullptr);
        classes->add(path_class, luminance(value));
    }
    // A path may soon be splatted there.
    void prefetch(Vec2f raster) const {
        const float x = std::floor(raster.x / reduction), y = std::floor(raster.y / reduction);
        if (film && x >= 0 && y >= 0 && x < float(film->width()) && y < float(film->height()))
            unit->prefetch(static_cast<int>(x), static_cast<int>(y));
    }
};

class PathTarget {
public:
    using State = PathState;

    PathTarget(MutationContext& context, const ImportanceMap& importance, const Split& split,
               const Spread& spread, bool background)
        : context_(context),
          importance_(importance),
          split_(split),
          spread_(spread),
          background_(background) {}

    PathRecorder recorder;
    int band = 0;  // if not 0: paths of other bands are none, and nothing is recorded

    uint32_t applicable(const State& x);
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

    // f* and colour of a path whose factors are all made; false where f* is not positive. Densities
    // are made where vertices first … last were changed.
    bool evaluate(State& state, int first, int last);

    uint64_t non_finite() const { return non_finite_; }

    const Change& change() const { return change_; }

private:
    bool finish(State& y);

    MutationContext& context_;
    const ImportanceMap& importance_;
    const Split& split_;
    const Spread& spread_;
    bool background_;
    uint32_t enabled_ = ~0u;
    // What applies by a path's class, its light, and whether it has near-specular vertices.
    struct Applicable {
        uint64_t key = 0;
        uint32_t mask = 0;
    };
    std::array<Applicable, 64> applicable_{};
    Change change_;
    uint64_t non_finite_ = 0;  // proposals whose contribution is none
};

}  // namespace usdmlt
