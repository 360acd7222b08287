#include "python/bind_mutations.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <map>

#include "base/floating_point.hpp"
#include "integrators/metropolis.hpp"
#include "python/mutants.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

using Weights = std::map<std::string, double>;

Settings make_settings(const Weights& mutation_weights, int depth, int min_edges, uint64_t seed,
                       bool margin, bool two_stage, bool selective) {
    Settings s;
    s.integrator = IntegratorKind::metropolis;
    s.depth = depth;
    s.min_edges = min_edges;
    s.seed = seed;
    s.filter.kind = margin ? PixelFilter::Kind::gaussian : PixelFilter::Kind::box;
    s.direct_light = DirectLight::chains;
    s.two_stage = two_stage;
    s.selective = selective;
    s.mutation_weights.assign(mutation_count, 0);
    for (int m = 0; m < mutation_count; ++m) {
        const auto weight = mutation_weights.find(std::string(mutation_name(m)));
        if (weight != mutation_weights.end()) s.mutation_weights[size_t(m)] = weight->second;
    }
    return s;
}

// Columns of a table, by name; a row is finished by end().
class Table {
public:
    void set(const std::string& name, double value) { columns_[name].push_back(value); }
    py::dict to_python() const {
        py::dict out;
        for (const auto& [name, values] : columns_)
            out[py::str(name)] = py::array(py::cast(values));
        return out;
    }

private:
    std::map<std::string, std::vector<double>> columns_;
};

// What histograms are made of.
void describe(const PathState& state, const std::string& suffix, Table& table) {
    const Path& path = state.path;
    const int k = path.edges();
    double total = 0, eye = 0, light = 0;
    for (int i = 1; i <= k; ++i) {
        if (path[i - 1].infinite || path[i].infinite) continue;
        const double r = length(path[i].position - path[i - 1].position);
        total += r;
        if (i == 1) light = r;
        if (i == k) eye = r;
    }
    table.set("class" + suffix, double(class_of(path)));
    table.set("edges" + suffix, k);
    table.set("raster_x" + suffix, path.raster.x);
    table.set("raster_y" + suffix, path.raster.y);
    table.set("log_target" + suffix, state.target.log());
    table.set("length" + suffix, total);
    table.set("eye_edge" + suffix, eye);
    table.set("light_edge" + suffix, light);
}

void describe_vertices(const Path& path, Table& table) {
    for (int v = 0; v < 3; ++v)
        for (int axis = 0; axis < 3; ++axis) {
            const Vec3f p = v <= path.edges() ? path[v].position : Vec3f{};
            table.set("vertex" + std::to_string(v) + "xyz"[axis], axis == 0   ? p.x
                                                                  : axis == 1 ? p.y
                                                                              : p.z);
        }
}

double log_of(const ScaledDouble& t) {
    return t.is_positive() ? t.log() : -std::numeric_limits<double>::infinity();
}

// PathTarget as run_chain sees it, which writes down the step and stays where it is.
struct WatchedTarget {
    using State = PathState;

    WatchedTarget(MetropolisScratch& scratch, const std::vector<Mutant>& mutants, Table& table)
        : target(scratch.target),
          context(scratch.context),
          selection(scratch.selection),
          mutants(mutants),
          table(table) {}

    PathTarget& target;
    MutationContext& context;
    const MutationSelection& selection;
    const std::vector<Mutant>& mutants;
    Table& table;
    int mutation = -1;
    bool made = false, accepted = false;
    double weight_before = 0, weight_after = 0;  // deposited
    ScaledDouble recorded;
    const State* after = nullptr;
    uint32_t mask_before = 0, mask_after = 0;

    uint32_t applicable(const State& x) {
        const uint32_t mask = target.applicable(x);
        (made ? mask_after : mask_before) = mask;
        return mask;
    }
    bool propose(int m, const State& x, State& y) {
        mutation = m;
        made = target.propose(m, x, y);
        recorded = context.recorded;
        return made;
    }
    double ratio(int m, const State& x, State& y) {
        after = &y;
        const Change change = target.change(), reversed = change.reversed();
        describe(y, "_after", table);
        table.set("log_forward", log_of(healthy_density(context, m, x.path, y.path, change)));
        table.set("log_back", log_of(healthy_density(context, m, y.path, x.path, reversed)));
        table.set("log_recorded", log_of(recorded));
        State anew = y;
        const int k = y.path.edges();
        const bool lit =
            update_scattering(context.scene, anew.path, 0, k) && target.evaluate(anew, 0, k);
        table.set("log_target_anew",
                  lit ? anew.target.log() : -std::numeric_limits<double>::infinity());
        const int split = change.join > 0 ? change.join - change.l - 1 : 0;
        table.set("log_term", log_of(term(context, m, x.path, y.path, change, split)));
        table.set("log_by_definition",
                  log_of(density_by_definition(context, m, x.path, y.path, change)));
        table.set("terms", count_terms(context, m, x.path, y.path, change));
        table.set("selected", selection.probability(m, mask_before));
        table.set("selected_back", selection.probability(m, mask_after));
        for (const Mutant& mutant : mutants) {
            const std::string name = mutant.name;
            table.set(name, log_of(mutant.density(context, m, x.path, y.path, change, false)));
            table.set(name + "_back",
                      log_of(mutant.density(context, m, y.path, x.path, reversed, true)));
        }
        return target.ratio(m, x, y);
    }
    void deposit(const State& state, double weight) {
        (accepted || &state == after ? weight_after : weight_before) += weight;
    }
    void accept(State&, State& y) {
        accepted = true;
        target.reject(y);
    }
    void reject(const State& y) { target.reject(y); }
};

// Single steps from starts ∝ the bootstrap's weights. Steps that made no y leave no row.
py::dict step_probe(const Scene& scene, const Weights& mutation_weights, int rounds,
                    uint32_t samples, int starts, int steps, int depth, int min_edges,
                    uint64_t seed, bool margin, bool two_stage, bool selective,
                    const std::vector<std::string>& mutant_names) {
    const FlushDenormals flush;
    const Settings settings =
        make_settings(mutation_weights, depth, min_edges, seed, margin, two_stage, selective);
    const MetropolisPlan plan(scene, settings);
    MetropolisScratch scratch(scene, plan);
    std::vector<Mutant> chosen;
    for (const Mutant& mutant : mutants())
        if (std::find(mutant_names.begin(), mutant_names.end(), mutant.name) != mutant_names.end())
            chosen.push_back(mutant);
    Table table;
    UnitStatistics& statistics = scratch.statistics.bootstrap;
    const size_t vertices = scratch.context.arena.available();
    double total_steps = 0;
    for (int round = 0; round < rounds; ++round) {
        const uint64_t key = hash_key(hash_key(seed, 0x70726f6265), uint64_t(round));
        const double b = scratch.bootstrap.draw(key, samples, statistics);
        if (!(b > 0)) continue;
        RandomStream random(hash_key(key, 1));
        scratch.bootstrap.choose_starts(starts, random.next_double(), scratch.starts);
        scratch.context.unit_key = hash_key(key, 2);
        for (int c = 0; c < starts; ++c) {
            const BootstrapEntry& start = scratch.bootstrap.entries()[scratch.starts[size_t(c)]];
            if (!scratch.bootstrap.restore(start, scratch.target, scratch.x, statistics)) continue;
            scratch.context.random = RandomStream(hash_key(hash_key(key, 3), uint64_t(c)));
            scratch.context.chain = uint32_t(c);
            scratch.context.lens_proposals = 0;
            for (int step = 0; step < steps; ++step) {
                WatchedTarget target(scratch, chosen, table);
                run_chain(target, scratch.selection, scratch.x, scratch.y, 1,
                          scratch.context.random, scratch.statistics.chains);
                ++total_steps;
                if (!target.made) continue;
                describe(scratch.x, "_before", table);
                table.set("mutation", target.mutation);
                table.set("cluster", double(round) * samples + start.sample);
                table.set("weight", b);
                table.set("weight_before", target.weight_before);
                table.set("weight_after", target.weight_after);
            }
            scratch.context.arena.give_all(scratch.x.path);
        }
    }
    py::dict out = table.to_python();
    out["steps"] = total_steps;
    out["leaked_vertices"] = vertices - scratch.context.arena.available();
    return out;
}

// Starts before and after they are spread, as chains have them. Not `within_band`: a mutant, which
// leaves it.
py::dict spread_probe(const Scene& scene, const Weights& mutation_weights, int rounds,
                      uint32_t samples, int starts, int depth, uint64_t seed, bool within_band) {
    const FlushDenormals flush;
    MetropolisPlan plan(scene, make_settings(mutation_weights, depth, 1, seed, false, true, true));
    MetropolisScratch scratch(scene, plan);
    UnitStatistics& statistics = scratch.statistics.bootstrap;
    plan.spread.mean_weight =
        scratch.bootstrap.draw(hash_key(seed, 1), samples, statistics) * samples / starts;
    Table table;
    const auto move = [&](MetropolisScratch& s, int64_t steps, RandomStream& random) {
        const int band = s.start.band;
        if (!within_band) s.start.band = 0;
        move_start(s, steps, random);
        s.start.band = band;
    };
    for (int round = 0; round < rounds; ++round) {
        const uint64_t key = hash_key(hash_key(seed, 2), uint64_t(round));
        const double b = scratch.bootstrap.draw(key, samples, statistics);
        for_each_start(scratch, plan.spread, starts, key, move, [&](int, const auto& entry) {
            scratch.bootstrap.restore(entry, scratch.target, scratch.x, statistics);
            describe(scratch.x, "_before", table);
            scratch.context.arena.give_all(scratch.x.path);
            describe(scratch.start, "_after", table);
            table.set("cluster", double(round) * samples + entry.sample);
            table.set("weight", b);
            table.set("weight_after", 1);
        });
    }
    return table.to_python();
}

// Entries of a bootstrap and the paths made of them again: `weight` is that of the entry,
// `expected` the one that follows from the path's target by w_s target/(q_s p_s).
py::dict start_probe(const Scene& scene, uint32_t samples, int depth, uint64_t seed) {
    const FlushDenormals flush;
    const Settings settings = make_settings({}, depth, 1, seed, false, true, true);
    const MetropolisPlan plan(scene, settings);
    MetropolisScratch scratch(scene, plan);
    UnitStatistics& statistics = scratch.statistics.bootstrap;
    scratch.bootstrap.draw(hash_key(seed, 0x7374617274), samples, statistics);
    std::vector<double> weight, expected;
    std::vector<int> roulettes;
    for (const BootstrapEntry& entry : scratch.bootstrap.entries()) {
        if (!scratch.bootstrap.restore(entry, scratch.target, scratch.x, statistics)) continue;
        const Path& path = scratch.x.path;
        const auto decisions = [&](int first, int last) {
            int count = -Continuation::certain;
            for (int i = first; i <= last; ++i) count += !path.is_delta(i);
            return std::max(count, 0);
        };
        const int n = decisions(1, entry.s - 2) + decisions(entry.s + 1, path.edges() - 1);
        const double w = power_heuristic(scene, path, entry.s);
        weight.push_back(entry.weight);
        expected.push_back(w * ratio(scratch.x.target, strategy_density(scene, path, entry.s)) /
                           std::pow(plan.split.continuation, n));
        roulettes.push_back(n);
        scratch.context.arena.give_all(path);
    }
    py::dict out;
    out["weight"] = py::array_t<double>(py::ssize_t(weight.size()), weight.data());
    out["expected"] = py::array_t<double>(py::ssize_t(expected.size()), expected.data());
    out["roulettes"] = py::array_t<int>(py::ssize_t(roulettes.size()), roulettes.data());
    out["continuation"] = plan.split.continuation;
    out["selective"] = plan.split.is_selective();
    return out;
}

// With G for near-specular vertices.
std::string glossy_class_name(const Path& path) {
    std::string name = class_name(class_of(path));
    for (int i = 1; i < path.edges(); ++i)
        if (is_near_specular(path, i)) name[size_t(i)] = 'G';
    return name;
}

// Many proposals of one mutation from one path: of the class, and nearest to a point of the raster.
// In a class with a G all near-specular vertices are one.
py::dict proposal_probe(const Scene& scene, const std::string& mutation,
                        const std::string& path_class, std::pair<float, float> raster, int count,
                        int depth, int min_edges, uint64_t seed) {
    const FlushDenormals flush;
    const Settings settings =
        make_settings({{mutation, 1.0}}, depth, min_edges, seed, false, false, false);
    const MetropolisPlan plan(scene, settings);
    MetropolisScratch scratch(scene, plan);
    MutationContext& context = scratch.context;
    UnitStatistics& statistics = scratch.statistics.bootstrap;
    scratch.bootstrap.draw(hash_key(seed, 1), 4096, statistics);
    int m = 0;
    while (mutation_name(m) != mutation) ++m;
    const bool glossy = path_class.find('G') != std::string::npos;
    const BootstrapEntry* nearest = nullptr;
    double distance = 0;
    for (const BootstrapEntry& entry : scratch.bootstrap.entries()) {
        if (!scratch.bootstrap.restore(entry, scratch.target, scratch.x, statistics)) continue;
        const Path& path = scratch.x.path;
        const double d = std::hypot(path.raster.x - raster.first, path.raster.y - raster.second);
        const std::string name = glossy ? glossy_class_name(path) : class_name(class_of(path));
        if (name == path_class && (!nearest || d < distance)) {
            nearest = &entry;
            distance = d;
        }
        context.arena.give_all(path);
    }
    if (!nearest || !scratch.bootstrap.restore(*nearest, scratch.target, scratch.x, statistics))
        throw std::invalid_argument("no path of class " + path_class);
    Table choices, made;
    const Path& x = scratch.x.path;
    context.random = RandomStream(hash_key(seed, 2));
    context.unit_key = hash_key(seed, 3);
    for (int i = 0; i < count; ++i) {
        context.chain = uint32_t(i);
        PathState& y = scratch.y;
        const bool success = scratch.target.propose(m, scratch.x, y);
        const Change change = scratch.target.change();
        choices.set("l", change.l);
        choices.set("m", change.m);
        choices.set("m_y", change.m_y);
        choices.set("made", success);
        if (!success) continue;
        describe(y, "", made);
        made.set("log_density", log_of(healthy_density(context, m, x, y.path, change)));
        describe_vertices(y.path, made);
        made.set("l", change.l);
        made.set("m", change.m);
        made.set("m_y", change.m_y);
        scratch.target.reject(y);
    }
    py::dict out;
    Table start;
    describe(scratch.x, "", start);
    describe_vertices(x, start);
    start.set("smallest_move", context.raster_range.min);
    start.set("largest_move", context.raster_range.max);
    out["start"] = start.to_python();
    out["choices"] = choices.to_python();
    out["made"] = made.to_python();
    return out;
}

// P(l, m, k_a) of the bidirectional mutation for a path of k edges.
std::vector<std::tuple<int, int, int, double>> bidirectional_choices(const Scene& scene, int k,
                                                                     int depth, int min_edges) {
    const MutationContext context(scene, RasterDomain(1, 1, 0), min_edges, depth);
    std::vector<std::tuple<int, int, int, double>> out;
    for (int l = -1; l <= k; ++l)
        for (int m = l + 1; m <= k + 1; ++m)
            for (int added = 1; added <= depth + 2; ++added) {
                if (m - l == 1 && (l < 0 || m > k)) continue;
                const Bidirectional::Choice c =
                    Bidirectional::choice(context, k, {l, m, l + added, -1});
                const double p = c.deletion * c.addition;
                if (p > 0) out.emplace_back(l, m, added, p);
            }
    return out;
}

// Directions about the z axis.
py::dict aimed_direction_probe(double xx, double xy, double yy, int count, uint64_t seed) {
    AimedDirection aimed;
    aimed.found = true;
    aimed.frame = Frame::from_normal({0, 0, 1});
    aimed.stretch = {xx, xy, 0, yy};
    RandomStream random(seed);
    Table table;
    for (int i = 0; i < count; ++i) {
        const Vec3f d = aimed.sample(random.next_2d());
        table.set("x", d.x);
        table.set("y", d.y);
        table.set("z", d.z);
        table.set("pdf", aimed.pdf(d));
    }
    return table.to_python();
}

}  // namespace

void bind_mutations(py::module_& module) {
    module.def(
        "step_probe", &step_probe, py::arg("scene"), py::arg("mutation_weights"), py::kw_only(),
        py::arg("rounds"), py::arg("samples"), py::arg("starts"), py::arg("steps") = 1,
        py::arg("depth") = 6, py::arg("min_edges") = 1, py::arg("seed") = 0,
        py::arg("margin") = true, py::arg("two_stage") = false, py::arg("selective") = false,
        py::arg("mutants") = std::vector<std::string>(),
        "Single steps of run_chain from paths of bidirectional path tracing, drawn in "
        "proportion to their weights. One row per proposal that was made: the states before "
        "and after, what each would deposit, densities, and those of the mutants that are named.");
    module.def("spread_probe", &spread_probe, py::arg("scene"), py::arg("mutation_weights"),
               py::kw_only(), py::arg("rounds"), py::arg("samples"), py::arg("starts"),
               py::arg("depth") = 6, py::arg("seed") = 0, py::arg("within_band") = true,
               "Starts of chains before and after they are spread, as rows of step_probe.");
    module.def("start_probe", &start_probe, py::arg("scene"), py::kw_only(), py::arg("samples"),
               py::arg("depth") = 8, py::arg("seed") = 0,
               "Weights of bidirectional samples in the chains' target, and those that follow from "
               "their finished paths.");
    module.def(
        "proposal_probe", &proposal_probe, py::arg("scene"), py::arg("mutation"),
        py::arg("path_class"), py::arg("raster"), py::kw_only(), py::arg("count"),
        py::arg("depth") = 6, py::arg("min_edges") = 1, py::arg("seed") = 0,
        "Many proposals from one path: what each was to change, and what was made. The class "
        "may have G for near-specular vertices.");
    module.def("bidirectional_choices", &bidirectional_choices, py::arg("scene"), py::arg("edges"),
               py::arg("depth"), py::arg("min_edges") = 1,
               "(l, m, added edges, probability) of all that the bidirectional mutation can draw.");
    module.def("aimed_direction_probe", &aimed_direction_probe, py::arg("xx"), py::arg("xy"),
               py::arg("yy"), py::kw_only(), py::arg("count"), py::arg("seed") = 0,
               "Directions of the aimed perturbation about the z axis, (count,) each, and their "
               "densities in solid angle.");
    module.def("mutant_names", [] {
        std::vector<std::string> names;
        for (const Mutant& mutant : mutants()) names.emplace_back(mutant.name);
        return names;
    });
}

}  // namespace usdmlt
