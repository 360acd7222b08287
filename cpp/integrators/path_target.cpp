#include "integrators/path_target.hpp"

#include <limits>

namespace usdmlt {
namespace {

void add_to_layers(const Path& path, const Spectrum& value, LayerScratch& layers) {
    layers.splat.clear();
    layers.classes.begin();
    for (int i = path.edges() - 1; i > 0; --i)
        layers.classes.scatter(
            scattering_event(path[i], path.to_light(i), path.to_eye(i), path.at(i).component));
    layers.classes.end(path[0], path[1], path.at(1).direction, value, layers.splat);
}

}  // namespace

bool PathTarget::evaluate(State& state, int first, int last) {
    const Contribution f = product_of_factors(state.path);
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += target_weights[c] * std::fabs(f.c[c]);
    const double w = importance_.weight(state.path.raster);
    sum *= w;
    if (!std::isfinite(sum)) ++non_finite_;
    if (!(sum > 0) || !std::isfinite(sum)) return false;
    for (int c = 0; c < 3; ++c) state.color[c] = static_cast<float>(f.c[c] / sum);
    state.target = sum;
    state.target.exponent += f.exponent;
    if (split_.is_selective()) {
        update_densities(context_.scene, state.path, first, last);
        const double q = split_.least_survival(rough_vertices(state.path));
        const double r_squared =
            sqr(1 / q) * usdmlt::ratio(state.target * state.target,
                                       squared_strategy_densities(state.path, context_.scratch));
        const double of_chains = split_.of_chains(r_squared);
        state.target *= of_chains;
        state.band = spread_.band(of_chains * std::sqrt(r_squared));
    }
    return band == 0 || state.band == band;
}

uint32_t PathTarget::applicable(const State& x) {
    if (x.path.edges() > longest_class) return applicable_mutations(context_, x.path) & enabled_;
    // Near-specular vertices are what is not in a path's class.
    const bool near = has_near_specular(x.path);
    const uint64_t key =
        class_of(x.path) << 2 | uint64_t(x.path[0].light.delta) << 1 | uint64_t(near);
    Applicable& known = applicable_[mix64(key) % applicable_.size()];
    if (known.key != key)
        known = {key, near ? applicable_mutations<true>(context_, x.path)
                           : applicable_mutations(context_, x.path)};
    const uint32_t others = near ? applicable_mutations<false>(context_, x.path) : 0;
    return (known.mask | others) & enabled_;
}

// The factors that the change touches, the visibility of the joined edge, and f*.
bool PathTarget::finish(State& y) {
    Path& path = y.path;
    const int k = path.edges();
    if (k == 1 && path[0].infinite && !background_) return false;
    update_edges(path, std::max(change_.l + 1, 1), std::min(change_.m_y, k));
    if (!update_scattering(context_.scene, path, std::max(change_.l, 0), std::min(change_.m_y, k)))
        return false;
    if (change_.join > 0) {
        PathVertex& v = path.at(change_.join);
        if (v.geometry == 0) return false;
        v.edge =
            edge_between(context_.scene, path[change_.join - 1], path[change_.join], context_.rays);
        if (v.edge.is_blocked()) return false;
        v.geometry *= v.edge.transmittance;
        if (!context_.scene.media.empty()) [[unlikely]]
            v.scattering *= v.edge.media_transmittance();
    }
    return evaluate(y, change_.l + 1, change_.m_y - 1);
}

bool PathTarget::propose(int m, const State& x, State& y) {
    change_ = {};
    const bool made = visit_mutation(
        m, [&]<typename M>() { return M::propose(context_, x.path, y.path, change_); });
    if (made) {
        // Both are deposited to where y is accepted.
        recorder.prefetch(x.path.raster);
        recorder.prefetch(y.path.raster);
        if (finish(y)) return true;
    }
    reject(y);
    return false;
}

double PathTarget::ratio(int m, const State& x, const State& y) {
    ScaledDouble forward, back;
    const Change reversed = change_.reversed();
    visit_mutation(m, [&]<typename M>() {
        forward = M::density(context_, x.path, y.path, change_);
        back = M::density(context_, y.path, x.path, reversed);
        return true;
    });
    if (forward.mantissa == 0) return 0;  // rounding at the end of a range
    if (!std::isfinite(forward.mantissa)) return std::numeric_limits<double>::quiet_NaN();
    return usdmlt::ratio(y.target * back, x.target * forward);
}

void PathTarget::deposit(const State& state, double weight) {
    if (recorder.pilot)
        recorder.pilot->add(context_, state.path, state.target, weight * luminance(state.color),
                            weight);
    if (!recorder.film || band != 0) return;
    const Spectrum value = state.color * static_cast<float>(weight * recorder.scale);
    if (recorder.layers) add_to_layers(state.path, value, *recorder.layers);
    recorder.splat(state.path.raster, value, class_of(state.path), context_.random);
}

}  // namespace usdmlt
