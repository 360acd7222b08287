#include "integrators/pilot_notes.hpp"

namespace usdmlt {

void PilotNotes::add(const MutationContext& context, const Path& path, const ScaledDouble& target,
                     double brightness, double weight) {
    picture.add(path.raster, brightness);
    if (count_++ % interval != 0) return;
    // The other integrators walk without guide.
    Path plain = path;
    std::vector<Vertex> vertices;
    vertices.reserve(plain.vertices.size());
    for (PathVertex& v : plain.vertices) {
        vertices.push_back(*v.vertex);
        vertices.back().closure.guide = nullptr;
        v.vertex = &vertices.back();
    }
    ScaledDouble by_path = 0, by_all = 0;
    for (int s = 0; s <= plain.edges(); ++s) {
        if (!has_strategy(plain, s)) continue;
        const ScaledDouble p = strategy_density(context.scene, plain, s);
        by_all += p;
        if (s <= 1) by_path += p;
    }
    // A path that an integrator cannot make at all has no error by it, and is missing.
    const auto ratio_to = [&](const ScaledDouble& p) {
        return p.is_positive() ? ratio(target, p) : 0.0;
    };
    notes_.push_back({picture.cell(path.raster), weight, ratio_to(by_path), ratio_to(by_all)});
}

PilotNotes::Errors PilotNotes::errors(double b, const CoarsePicture& finished) const {
    const std::vector<double>& sums = finished.sums();
    double mean = 0, total = 0, path_squares = 0, bidirectional_squares = 0;
    for (const double s : sums) mean += s / CoarsePicture::count;
    Errors errors;
    if (!(mean > 0)) return errors;
    for (const Note& note : notes_) {
        const double r = sums[note.cell] / mean;
        const double w = note.weight / (r * r + 0.01);
        errors.path += w * note.path;
        errors.bidirectional += w * note.bidirectional;
        path_squares += w * note.path * (w * note.path);
        bidirectional_squares += w * note.bidirectional * (w * note.bidirectional);
        total += note.weight;
    }
    const auto effective = [](double sum, double squares) {
        return squares > 0 ? sum * sum / squares : 0;
    };
    errors.path_notes = effective(errors.path, path_squares);
    errors.bidirectional_notes = effective(errors.bidirectional, bidirectional_squares);
    // f*/p is radiance; R is relative to the mean.
    const double scale = total > 0 ? b / (total * mean * mean) : 0;
    errors.path *= scale;
    errors.bidirectional *= scale;
    return errors;
}

}  // namespace usdmlt
