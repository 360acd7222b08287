// What the first chains of a pilot tell: a coarse picture, and how other integrators would fare.
//
// An estimator f/p of density p has the second moment ∫ f²/p, which chains that visit paths ∝ f*
// estimate without ever sampling p:
//     ∫ W f*²/p = b E[W f*/p],      p = Σ_s p_s over the strategies that the integrator combines
// (as the balance heuristic has it). Rare bright samples, which a pilot of the integrator itself
// would most likely miss, are where these chains are.
#pragma once

#include "integrators/importance_map.hpp"
#include "integrators/path_classes.hpp"
#include "integrators/split.hpp"

namespace usdmlt {

class PilotNotes {
public:
    // `unsplit`: what is known of the split before it is planned.
    PilotNotes(const RasterDomain& domain, double cells, const Split& unsplit)
        : picture(domain, cells), unsplit_(unsplit) {}

    CoarsePicture picture;

    // `brightness`: of the deposit; `weight`: the steps it stands for.
    void add(MutationContext& context, const Path& path, const ScaledDouble& target,
             double brightness, double weight);

    // Error of path tracing and of bidirectional path tracing at one sample per pixel, relative as
    // var / (R² + ε), of the light that the chains carry; `b`: of the chains' target; R: the
    // finished picture.
    // `…_notes`: of how many of the chains' paths they are made, (Σ e)²/Σ e².
    struct Errors {
        double path = 0, bidirectional = 0;
        double path_notes = 0, bidirectional_notes = 0;
    };
    Errors errors(double b, const CoarsePicture& finished) const;

    // The split, and the share of the work that bidirectional samples get, by which the error in
    // equal time is least. With F = w f* g the chains' target, C the cost of a bidirectional
    // sample in mutations and W = 1 / (R² + ε), samples of each kind have errors
    //     E_B = C ∫ W ((1 − g) f)² / p,      E_M = τ ∫ F ∫ W g f*/w,
    // and shares α, 1 − α of the work give E_B/α + E_M/(1 − α), least for α ∝ √E_B. Within bounds:
    // the mean of the picture, and that of its larger parts, hangs on the samples. C has the direct
    // light that is path traced beside a sample, which bidirectional samples alone do not need.
    struct Plan {
        Split split;
        double share;
        double relative_error;  // of the whole, to that of bidirectional samples alone
    };
    Plan plan_split(double b, const CoarsePicture& finished, const ImportanceMap& importance,
                    double sample_cost, double direct_cost) const;

private:
    struct Note {
        Vec2f raster;
        double weight, path, bidirectional;  // f*/p
        double r_squared;                    // f*²/(q²Σp_s²) by walks with the guide, see Split
    };
    // Densities cost much beside a mutation.
    static constexpr uint32_t interval = 8;
    Split unsplit_;
    uint32_t count_ = 0;
    std::vector<Note> notes_;
};

}  // namespace usdmlt
