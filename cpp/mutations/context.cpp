#include "mutations/context.hpp"

namespace usdmlt {
namespace {

constexpr double largest_move_of_area = 0.05;  // of the image: π r² (Veach 1997, §11.3.3)
// In pixels. Of log-uniform moves from Veach's 0.1 on, two in five end less than a pixel away, and
// tell that pixel little that is new: from 0.5 on, the ajar door has a tenth less error.
constexpr double smallest_move = 0.5;

}  // namespace

StrategyTable::StrategyTable(const std::vector<std::vector<double>>& weights)
    : probability_(weights) {
    double sum = 0;
    for (const auto& row : probability_)
        for (const double w : row) sum += w;
    if (!(sum > 0)) return;
    for (auto& row : probability_)
        for (double& p : row) p /= sum;
}

bool StrategyTable::sample(double u, int& k, int& s) const {
    for (size_t i = 0; i < probability_.size(); ++i)
        for (size_t j = 0; j < probability_[i].size(); ++j) {
            if (probability_[i][j] == 0) continue;
            k = static_cast<int>(i);
            s = static_cast<int>(j);
            u -= probability_[i][j];
            if (u < 0) return true;
        }
    return false;
}

MutationContext::MutationContext(const Scene& scene, const RasterDomain& domain, int min_edges,
                                 int max_edges)
    : scene(scene),
      domain(domain),
      min_edges(min_edges),
      max_edges(max_edges),
      raster_range(LogarithmicRange::of_a_decade_at_least(
          smallest_move, std::sqrt(largest_move_of_area * domain.image_area / std::numbers::pi))),
      arena(4 * (max_edges + 2)),
      scratch(max_edges) {}

}  // namespace usdmlt
