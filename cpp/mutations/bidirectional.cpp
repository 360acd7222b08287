#include "mutations/bidirectional.hpp"

#include <cstdlib>

namespace usdmlt {
namespace {

// (l, m) that can be deleted: −1 ≤ l < m ≤ k + 1, where neither end's vertex is kept without its
// edges (a light point or a lens has no scattering to walk on with): l ≤ k − 1, m ≥ 1.
int first_l(int deleted) { return deleted == 1 ? 0 : -1; }
int count_of_l(int k, int deleted) { return deleted == 1 ? k : k + 3 - deleted; }

// p_d by length, before normalisation. A single edge can only come back as more of them: at the
// depth limit it is not deleted.
struct Deletions {
    int first;     // fewest edges deleted
    double total;  // Σ over first … k + 2

    Deletions(const MutationContext& context, int k)
        : first(k < context.max_edges ? 1 : 2),
          total(1 - std::ldexp(1.0, -(k + 2)) - (first == 1 ? 0 : 0.25)) {}
    static double weight(int deleted) {
        return deleted == 1 ? 0.25 : deleted == 2 ? 0.5 : std::ldexp(1.0, -deleted);
    }
    double probability(int k, int deleted) const {
        return deleted < first ? 0 : weight(deleted) / (total * count_of_l(k, deleted));
    }
};

double addition_weight(int difference) {
    const int j = std::abs(difference);
    return j == 0 ? 0.5 : j == 1 ? 0.15 : std::ldexp(0.2, -j);
}

// The k_a that can be drawn for a path of k edges and deletion (l, m): first … last, but for the
// null change.
struct Additions {
    int deleted, first, last;
    bool skips_one;

    Additions(const MutationContext& context, int k, int l, int m) : deleted(m - l) {
        const int kept = k - deleted;  // edges of y: kept + k_a
        // A whole end that is gone has to come back by one vertex at least.
        first = std::max(1 + (l == -1) + (m == k + 1), context.min_edges - kept);
        last = context.max_edges - kept;
        skips_one = deleted == 1 && first == 1;  // joins the same two vertices again
        if (skips_one) first = 2;
    }
    double total() const {
        double sum = 0;
        for (int a = first; a <= last; ++a) sum += addition_weight(a - deleted);
        return sum;
    }
    double probability(int added) const {
        if (added < first || added > last) return 0;
        return addition_weight(added - deleted) / total();
    }
    // 0 where none can be drawn.
    int sample(double u) const {
        double rest = u * total();
        for (int a = first; a <= last; ++a) {
            rest -= addition_weight(a - deleted);
            if (rest < 0 || a == last) return a;
        }
        return 0;
    }
};

// Splits of `added` edges' new vertices: from_light = 0 … added − 1, but the lens is not made from
// the light's side.
int count_of_splits(int k, int m, int added) { return m == k + 1 ? added - 1 : added; }

}  // namespace

bool Bidirectional::propose(MutationContext& context, const Path& x, Path& y, Change& change) {
    const int k = x.edges();
    RandomStream& random = context.random;
    const Deletions deletions(context, k);
    double u = random.next_double() * deletions.total;
    int deleted = deletions.first;
    while (deleted < k + 2 && (u -= Deletions::weight(deleted)) >= 0) ++deleted;
    const int count = count_of_l(k, deleted);
    const int l =
        first_l(deleted) + std::min(static_cast<int>(random.next_double() * count), count - 1);
    const int m = l + deleted;
    change = {l, m, l + 1, -1};
    const Additions additions(context, k, l, m);
    const int added = additions.sample(random.next_double());
    if (added == 0) return false;
    const int splits = count_of_splits(k, m, added);
    const int from_light = std::min(static_cast<int>(random.next_double() * splits), splits - 1);
    if (!make_segment(context, x, change, from_light, added - 1 - from_light, y)) return false;
    context.recorded *= deletions.probability(k, deleted) * additions.probability(added) / splits;
    return true;
}

Bidirectional::Choice Bidirectional::choice(const MutationContext& context, int k,
                                            const Change& change) {
    const int l = change.l, m = change.m, deleted = m - l, added = change.m_y - l;
    return {Deletions(context, k).probability(k, deleted),
            Additions(context, k, l, m).probability(added), count_of_splits(k, m, added)};
}

ScaledDouble Bidirectional::density(MutationContext& context, const Path& x, const Path& y,
                                    const Change& change) {
    const Choice c = choice(context, x.edges(), change);
    if (c.addition == 0) return 0;
    const double choices = c.deletion * c.addition / c.splits;
    return sum_over_splits(context, y, change.l, change.m_y,
                           [&](int j) { return j < c.splits ? choices : 0.0; });
}

}  // namespace usdmlt
