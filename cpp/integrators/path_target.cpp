#include "integrators/path_target.hpp"

#include <limits>

namespace usdmlt {

bool PathTarget::evaluate(State& state) {
    const Contribution f = product_of_factors(state.path);
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += target_weights[c] * std::fabs(f.c[c]);
    sum *= importance_.weight(state.path.raster);
    if (!std::isfinite(sum)) ++non_finite_;
    if (!(sum > 0) || !std::isfinite(sum)) return false;
    for (int c = 0; c < 3; ++c) state.color[c] = static_cast<float>(f.c[c] / sum);
    state.target = sum;
    state.target.exponent += f.exponent;
    return true;
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
        v.edge = transmittance(context_.scene, path[change_.join - 1], path[change_.join],
                               context_.rays);
        if (v.edge == 0) return false;
        v.geometry *= v.edge;
    }
    return evaluate(y);
}

bool PathTarget::propose(int m, const State& x, State& y) {
    change_ = {};
    const bool made = visit_mutation(
        m, [&]<typename M>() { return M::propose(context_, x.path, y.path, change_); });
    if (made && finish(y)) return true;
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
    if (!recorder.film) return;
    Vec2f offset;
    if (recorder.filter->kind != PixelFilter::Kind::box)
        offset = recorder.filter->offset(context_.random.next_2d());
    const float px = std::floor((state.path.raster.x - offset.x) / recorder.reduction);
    const float py = std::floor((state.path.raster.y - offset.y) / recorder.reduction);
    Film& film = *recorder.film;
    if (!(px >= 0 && py >= 0 && px < float(film.width()) && py < float(film.height()))) return;
    const Spectrum value = state.color * static_cast<float>(weight * recorder.scale);
    film.add_splat(static_cast<int>(px), static_cast<int>(py), value, recorder.batch);
    recorder.classes->add(state.path, luminance(value));
}

}  // namespace usdmlt
