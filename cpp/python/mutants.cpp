#include "python/mutants.hpp"

#include "mutations/aim.hpp"

namespace usdmlt {
namespace {

bool is(int m, const char* name) { return mutation_name(m) == name; }
bool is_caustic(int m) {
    return is(m, CausticPerturbation::name) || is(m, GlossyCausticPerturbation::name);
}
bool joins(int m) { return is(m, NewPath::name) || is(m, Bidirectional::name); }
// Perturbations: surfaces and points of media stay what they are.
bool keeps_distances(int m) { return !joins(m) && !is(m, LensSubpath::name); }

// One way in which y's new vertices y_{l+1} … y_{m_y−1} were made: `split` of them from the light's
// side, the others from the eye's.
struct Making {
    int l, m_y, split, k;

    int join() const { return l + 1 + split; }  // edge y_{join−1} y_join
    bool joined() const { return join() > 0 && join() <= k; }
    // Calls f(from, to) for every vertex that a ray from another one found.
    template <typename F>
    void for_each_traced(F&& f) const {
        for (int i = std::max(l + 1, 1); i < join(); ++i) f(i - 1, i);
        for (int i = std::min(m_y - 1, k - 1); i >= join(); --i) f(i + 1, i);
    }
    // Those of them that end their run.
    template <typename F>
    void for_each_end(F&& f) const {
        for_each_traced([&](int from, int to) {
            if (to == (from < to ? join() - 1 : join())) f(from, to);
        });
    }
};

double edge_of(const Path& y, int from, int to) {
    return y.at(std::max(from, to))
        .edge.survival_of_surfaces(to < from ? Known::eye : Known::light);
}

// Of media: where the ray stops by chance.
double media_of(const Path& y, int from, int to) {
    return y.at(std::max(from, to)).edge.survival_of_media(to < from ? Known::eye : Known::light);
}

// Cosine and distance of the conversion from solid angle to area.
double cosine(const Path& y, int from, int to) {
    return y[to].infinite ? 1.0 : double(abs_cosine(y[to], y.at(std::max(from, to)).direction));
}
double distance_squared(const Path& y, int from, int to) {
    if (y[from].infinite || y[to].infinite) return 1;
    return length_squared(y[to].position - y[from].position);
}

// T with every way of making y weighted by factor(making).
template <typename Factor>
ScaledDouble weighted_density(MutationContext& context, int m, const Path& x, const Path& y,
                              const Change& change, const Factor& factor) {
    const int k = y.edges(), l = change.l, m_y = change.m_y;
    const ScaledDouble t = healthy_density(context, m, x, y, change);
    if (!t.is_positive()) return t;
    if (!joins(m)) {
        const int split = is_caustic(m) ? m_y - l - 1 : 0;
        return t * factor(Making{l, m_y, split, k});
    }
    const auto sum = [&](auto&& weight) {
        if (is(m, NewPath::name))
            return sum_over_splits(context, y, l, m_y, [&](int j) {
                return context.strategies.probability(k, j) * weight(j);
            });
        const Bidirectional::Choice c = Bidirectional::choice(context, x.edges(), change);
        const double choices = c.deletion * c.addition / c.splits;
        return sum_over_splits(context, y, l, m_y,
                               [&](int j) { return j < c.splits ? choices * weight(j) : 0.0; });
    };
    return sum([&](int j) { return factor(Making{l, m_y, j, k}); });
}

// The cosine of the last traced vertex is left out of its conversion to area.
ScaledDouble end_cosine(MutationContext& context, int m, const Path& x, const Path& y,
                        const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_end([&](int from, int to) { c /= cosine(y, from, to); });
        return c;
    });
}

// So is the squared distance.
ScaledDouble end_distance(MutationContext& context, int m, const Path& x, const Path& y,
                          const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_end([&](int from, int to) { c *= distance_squared(y, from, to); });
        return c;
    });
}

// The conversions of all traced vertices but the last are left out.
ScaledDouble inner_conversion(MutationContext& context, int m, const Path& x, const Path& y,
                              const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        const auto conversion = [&](int from, int to) {
            return cosine(y, from, to) / distance_squared(y, from, to);
        };
        making.for_each_traced([&](int from, int to) { c /= conversion(from, to); });
        making.for_each_end([&](int from, int to) { c *= conversion(from, to); });
        return c;
    });
}

// G of the joined edge, which is in f, is counted in T as well.
ScaledDouble joined_geometry(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        const int j = making.join();
        return making.joined() ? geometry_term(y[j - 1], y[j], y.at(j).direction) : 1.0;
    });
}

// Partial opacity, of what rays passed and of where they ended, is left out.
ScaledDouble coverage(MutationContext& context, int m, const Path& x, const Path& y,
                      const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced(
            [&](int from, int to) { c /= edge_of(y, from, to) * double(y[to].opacity); });
        return c;
    });
}

// Raster points are taken for uniform over the image, whereas the domain has a margin.
ScaledDouble raster_domain(MutationContext& context, int m, const Path& x, const Path& y,
                           const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        const bool from_raster = making.join() < making.k && making.m_y >= making.k;
        return from_raster ? 1 / context.domain.density_scale() : 1.0;
    });
}

// The light point of direct sampling has the density of light subpaths' points.
ScaledDouble light_point(MutationContext& context, int m, const Path& x, const Path& y,
                         const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        if (making.l >= 0 || making.join() != 1) return 1.0;
        const Lights& lights = context.scene.lights;
        return pdf_point(lights, y[0].light) / pdf_direct(lights, y[0].light, y[1].position);
    });
}

// The Dirac unit |cosθ|η² is left out of traced components.
ScaledDouble dirac_measure(MutationContext& context, int m, const Path& x, const Path& y,
                           const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced([&](int from, int to) {
            if (from <= 0 || from >= making.k || !y.is_delta(from)) return;
            const Vec3f direction = to > from ? y.to_eye(from) : y.to_light(from);
            c /= y[from].closure.delta_measure(direction, y.at(from).component);
        });
        return c;
    });
}

// The probability of the Dirac component that was chosen is left out.
ScaledDouble lobe_choice(MutationContext& context, int m, const Path& x, const Path& y,
                         const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced([&](int from, int to) {
            if (from <= 0 || from >= making.k || !y.is_delta(from)) return;
            const bool to_eye = to > from;
            const Vec3f sampled = to_eye ? y.to_eye(from) : y.to_light(from);
            const Vec3f known = to_eye ? y.to_light(from) : y.to_eye(from);
            const Closure& closure = y[from].closure;
            const Component component = y.at(from).component;
            c *= closure.delta_measure(sampled, component) /
                 closure.pdf(known, sampled, to_eye ? Known::light : Known::eye, component);
        });
        return c;
    });
}

// That a walk ends where it could have gone on by a Dirac component, by chance.
ScaledDouble stop_choice(MutationContext& context, int m, const Path& x, const Path& y,
                         const Change& change, bool) {
    const int end = change.l + 1;
    const Closure& closure = y[end].closure;
    double stop = 1;
    for (int lobe = 0; lobe < closure.lobe_count; ++lobe) {
        if (!closure.lobes[lobe].delta) continue;
        for (const Component c : {delta_reflection(lobe), delta_transmission(lobe)}) {
            Vec3f direction;
            if (closure.delta_direction(y.to_eye(end), c, direction))
                stop -= closure.pdf(y.to_eye(end), direction, Known::eye, c) /
                        closure.delta_measure(direction, c);
        }
    }
    return healthy_density(context, m, x, y, change) * (1 / stop);
}

// That one of the path's caustic walks is chosen.
ScaledDouble start_choice(MutationContext& context, int m, const Path& x, const Path& y,
                          const Change& change, bool) {
    const double starts = is(m, CausticPerturbation::name) ? CausticPerturbation::count_starts(x)
                          : is(m, GlossyCausticPerturbation::name)
                              ? GlossyCausticPerturbation::count_starts(x)
                              : 1;
    return healthy_density(context, m, x, y, change) * starts;
}

// Only the most likely split counts.
ScaledDouble largest_split(MutationContext& context, int m, const Path& x, const Path& y,
                           const Change& change, bool) {
    ScaledDouble largest = 0;
    for (int j = 0; j < change.m_y - change.l; ++j) {
        const ScaledDouble t = term(context, m, x, y, change, j);
        if (t.is_positive() && (!largest.is_positive() || ratio(t, largest) > 1)) largest = t;
    }
    return largest;
}

// p_d, p_a or 1/n of the bidirectional mutation is left out.
template <typename Factor>
ScaledDouble without_choice(MutationContext& context, int m, const Path& x, const Path& y,
                            const Change& change, const Factor& factor) {
    ScaledDouble t = healthy_density(context, m, x, y, change);
    if (!is(m, Bidirectional::name) || !t.is_positive()) return t;
    return t * factor(Bidirectional::choice(context, x.edges(), change));
}
ScaledDouble deletion_choice(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change, bool) {
    return without_choice(context, m, x, y, change,
                          [](const Bidirectional::Choice& c) { return 1 / c.deletion; });
}
ScaledDouble addition_choice(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change, bool) {
    return without_choice(context, m, x, y, change,
                          [](const Bidirectional::Choice& c) { return 1 / c.addition; });
}
ScaledDouble split_count(MutationContext& context, int m, const Path& x, const Path& y,
                         const Change& change, bool) {
    return without_choice(context, m, x, y, change,
                          [](const Bidirectional::Choice& c) { return double(c.splits); });
}

// P(k, s) of new paths is left out: all strategies count alike.
ScaledDouble strategy_choice(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change, bool) {
    if (!is(m, NewPath::name)) return healthy_density(context, m, x, y, change);
    return sum_over_splits(context, y, -1, change.m_y, [](int) { return 1.0; });
}

// The caustic perturbation takes the range of the path it came from for the way back.
ScaledDouble forward_range(MutationContext& context, int m, const Path& x, const Path& y,
                           const Change& change, bool back) {
    if (!is(m, CausticPerturbation::name)) return healthy_density(context, m, x, y, change);
    return CausticPerturbation::density(context, x, y, change, back ? y : x);
}

// The conversion from half vectors to solid angle is left out.
ScaledDouble half_vector(MutationContext& context, int m, const Path& x, const Path& y,
                         const Change& change, bool) {
    const bool glossy = is(m, GlossyLensPerturbation::name) ||
                        is(m, GlossyCausticPerturbation::name) || is(m, AimedPerturbation::name);
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced([&](int from, int) {
            if (glossy && is_near_specular(y, from))
                c /= half_vector_pdf(y.to_eye(from), y.to_light(from));
        });
        return c;
    });
}

// T without a factor of every direction that was aimed.
template <typename Factor>
ScaledDouble without_aimed(MutationContext& context, int m, const Path& x, const Path& y,
                           const Change& change, const Factor& factor) {
    ScaledDouble t = healthy_density(context, m, x, y, change);
    if (!is(m, AimedPerturbation::name) || !t.is_positive()) return t;
    const Walk walk = AimedPerturbation::walk_of(x);
    for (int i = walk.start + walk.step(); i != walk.end; i += walk.step()) {
        if (is_passed(x, walk, i)) continue;
        t *= 1 / factor(aim(context, x, walk, i, y[i]), y.to_light(i));
    }
    return t;
}
// Directions are taken for equally dense whatever the chain does to them.
ScaledDouble stretch(MutationContext& context, int m, const Path& x, const Path& y,
                     const Change& change, bool) {
    return without_aimed(context, m, x, y, change, [](const AimedDirection& aimed, Vec3f) {
        return aimed.stretch.determinant();
    });
}
// Or all around where they were aimed.
ScaledDouble aimed_direction(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change, bool) {
    return without_aimed(context, m, x, y, change,
                         [](const AimedDirection& aimed, Vec3f direction) {
                             return aimed.pdf(direction) / aimed.pdf(aimed.frame.z);
                         });
}

// The density of the new lens point lacks its 1/r.
ScaledDouble lens_point(MutationContext& context, int m, const Path& x, const Path& y,
                        const Change& change, bool) {
    ScaledDouble t = healthy_density(context, m, x, y, change);
    const bool walks = is(m, LensPerturbation::name) || is(m, MultiChainPerturbation::name) ||
                       is(m, GlossyLensPerturbation::name) || is(m, AimedPerturbation::name);
    if (walks && change.m == x.edges() + 1)
        t *= length(y[y.edges()].position - x[x.edges()].position);
    return t;
}

// Stops in media by chance, that is p(t) and the probability to come to a surface, are left out.
ScaledDouble collision_density(MutationContext& context, int m, const Path& x, const Path& y,
                               const Change& change, bool) {
    if (keeps_distances(m)) return healthy_density(context, m, x, y, change);
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced([&](int from, int to) { c /= media_of(y, from, to); });
        return c;
    });
}

// They are counted where walks keep what they had.
ScaledDouble media_survival(MutationContext& context, int m, const Path& x, const Path& y,
                            const Change& change, bool) {
    if (!keeps_distances(m)) return healthy_density(context, m, x, y, change);
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced([&](int from, int to) { c *= media_of(y, from, to); });
        return c;
    });
}

// The factor 1/(2t') of distances that were perturbed is left out.
ScaledDouble distance_factor(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change, bool) {
    if (!keeps_distances(m)) return healthy_density(context, m, x, y, change);
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced([&](int from, int to) {
            if (y[to].is_medium() && !y[from].infinite)
                c *= 2 * std::sqrt(distance_squared(y, from, to));
        });
        return c;
    });
}

// Points of media have a cosine, as surfaces do.
ScaledDouble medium_cosine(MutationContext& context, int m, const Path& x, const Path& y,
                           const Change& change, bool) {
    return weighted_density(context, m, x, y, change, [&](const Making& making) {
        double c = 1;
        making.for_each_traced([&](int from, int to) {
            if (y[to].is_medium()) c *= abs_dot(y[to].normal, y.at(std::max(from, to)).direction);
        });
        return c;
    });
}

}  // namespace

ScaledDouble healthy_density(MutationContext& context, int m, const Path& x, const Path& y,
                             const Change& change) {
    return visit_mutation(m, [&]<typename M>() { return M::density(context, x, y, change); });
}

ScaledDouble term(MutationContext& context, int m, const Path& x, const Path& y,
                  const Change& change, int j) {
    if (!joins(m)) return healthy_density(context, m, x, y, change);
    return weighted_density(context, m, x, y, change,
                            [j](const Making& making) { return making.split == j ? 1.0 : 0.0; });
}

int count_terms(MutationContext& context, int m, const Path& x, const Path& y,
                const Change& change) {
    if (!joins(m)) return 1;
    int count = 0;
    for (int j = 0; j < change.m_y - change.l; ++j)
        count += term(context, m, x, y, change, j).is_positive();
    return count;
}

ScaledDouble density_by_definition(MutationContext& context, int m, const Path& x, const Path& y,
                                   const Change& change) {
    if (!joins(m)) return healthy_density(context, m, x, y, change);
    const int k = y.edges(), l = change.l, n = change.m_y - l - 1;
    const Bidirectional::Choice c = Bidirectional::choice(context, x.edges(), change);
    ScaledDouble sum = 0;
    for (int j = 0; j <= n; ++j) {
        const int s = l + 1 + j;  // vertices on the light's side of the join
        if (!has_strategy(y, s)) continue;
        ScaledDouble p = is(m, NewPath::name) ? context.strategies.probability(k, j)
                         : j < c.splits       ? c.deletion * c.addition / c.splits
                                              : 0;
        for (int i = l + 1; i < s; ++i)
            p *= i == 0 && s == 1 ? pdf_direct(context.scene.lights, y[0].light, y[1].position)
                                  : density_from_light_side(context.scene, y, i);
        for (int i = s; i < change.m_y; ++i)
            p *= density_from_eye_side(context.scene, y, i) *
                 (i == k - 1 ? context.domain.density_scale() : 1);
        sum += p;
    }
    return sum;
}

std::span<const Mutant> mutants() {
    static constexpr Mutant all[] = {
        {"end_cosine", end_cosine},
        {"end_distance", end_distance},
        {"inner_conversion", inner_conversion},
        {"joined_geometry", joined_geometry},
        {"coverage", coverage},
        {"raster_domain", raster_domain},
        {"light_point", light_point},
        {"dirac_measure", dirac_measure},
        {"lobe_choice", lobe_choice},
        {"stop_choice", stop_choice},
        {"start_choice", start_choice},
        {"largest_split", largest_split},
        {"deletion_choice", deletion_choice},
        {"addition_choice", addition_choice},
        {"split_count", split_count},
        {"strategy_choice", strategy_choice},
        {"forward_range", forward_range},
        {"half_vector", half_vector},
        {"stretch", stretch},
        {"aimed_direction", aimed_direction},
        {"lens_point", lens_point},
        {"collision_density", collision_density},
        {"media_survival", media_survival},
        {"distance_factor", distance_factor},
        {"medium_cosine", medium_cosine},
    };
    return all;
}

}  // namespace usdmlt
