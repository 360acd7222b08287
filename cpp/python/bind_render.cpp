#include "python/bind_render.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <map>

#include "integrators/render.hpp"
#include "python/bind_layers.hpp"
#include "python/polling.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

Settings make_settings(const std::string& integrator, int samples, int depth, uint64_t seed,
                       const std::string& filter, int min_edges, bool background,
                       const std::string& direct, bool two_stage,
                       const std::map<std::string, double>& mutation_weights, bool error_layer,
                       int reduction, bool selective) {
    Settings s;
    if (integrator == "bdpt")
        s.integrator = IntegratorKind::bidirectional;
    else if (integrator == "mlt")
        s.integrator = IntegratorKind::metropolis;
    else if (integrator != "path")
        throw std::invalid_argument("unknown integrator '" + integrator + "'");
    if (filter == "box")
        s.filter.kind = PixelFilter::Kind::box;
    else if (filter != "gaussian")
        throw std::invalid_argument("unknown pixel filter '" + filter + "'");
    if (samples < 1) throw std::invalid_argument("samples must be at least 1");
    if (depth < 1) throw std::invalid_argument("depth must be at least 1");
    s.samples = samples;
    s.depth = depth;
    s.seed = seed;
    s.min_edges = min_edges;
    s.background = background;
    if (direct == "separate")
        s.direct_light = DirectLight::separate;
    else if (direct == "mlt")
        s.direct_light = DirectLight::chains;
    else if (direct != "auto")
        throw std::invalid_argument("unknown renderer of direct light '" + direct + "'");
    s.two_stage = two_stage;
    s.error_layer = error_layer;
    s.reduction = reduction;
    s.selective = selective;
    if (!mutation_weights.empty()) {
        s.mutation_weights.assign(mutation_count, 0);
        for (const auto& [name, weight] : mutation_weights) {
            int m = 0;
            while (m < mutation_count && mutation_name(m) != name) ++m;
            if (m == mutation_count) throw std::invalid_argument("unknown mutation '" + name + "'");
            s.mutation_weights[size_t(m)] = weight;
        }
    }
    return s;
}

int64_t run(Render& render, int64_t last_unit, int threads, std::optional<double> deadline_seconds,
            const std::optional<py::function>& poll, std::optional<int64_t> first_unit) {
    RunLimits limits;
    limits.threads = std::max(threads, 1);
    limits.seconds = deadline_seconds ? std::max(*deadline_seconds, 1e-9) : 0;
    Poll polling(poll);
    const int64_t before = render.units_done();
    const int64_t first = first_unit.value_or(render.units().prefix());
    if (first < 0) throw std::invalid_argument("there is no such unit");
    int64_t end = first;
    limits.poll = [&](int64_t started) { return polling(before + started); };
    {
        const py::gil_scoped_release release;
        end = render.run(first, std::min(last_unit, render.units_total()), limits);
    }
    polling.raise();
    return end;
}

py::dict saved(const Render& render) {
    const Render::Saved saved = render.saved();
    py::dict out;
    out["units"] = saved.units;
    out["statistics"] = saved.statistics;
    out["metropolis"] = saved.metropolis.sums;
    out["path_classes"] = saved.metropolis.energy;
    out["longest_rejection"] = saved.metropolis.longest_rejection;
    out["overflows"] = saved.overflows;
    out["seconds"] = saved.seconds;
    out["cpu_seconds"] = saved.cpu_seconds;
    return out;
}

void add_saved(Render& render, const py::dict& saved) {
    render.add({saved["units"].cast<std::vector<UnitSet::Range>>(),
                saved["statistics"].cast<std::vector<int64_t>>(),
                {saved["metropolis"].cast<std::vector<int64_t>>(),
                 saved["longest_rejection"].cast<uint64_t>(),
                 saved["path_classes"].cast<std::vector<std::pair<uint64_t, int64_t>>>()},
                saved["overflows"].cast<uint64_t>(),
                saved["seconds"].cast<double>(),
                saved["cpu_seconds"].cast<double>()});
}

py::array_t<float> image(const Render& render) {
    const Film& film = render.film();
    py::array_t<float> out({film.height(), film.width(), 4});
    render.develop(out.mutable_data());
    return out;
}

py::array_t<float> error(const Render& render) {
    py::array_t<float> out({render.film().height(), render.film().width()});
    render.develop_error(out.mutable_data());
    return out;
}

py::array_t<float> layer(const Render& render, int index) {
    const Film& film = render.film();
    if (index < 0 || index >= film.layers()) throw py::index_error("no such layer");
    py::array_t<float> out({film.height(), film.width(), 3});
    render.develop_layer(index, out.mutable_data());
    return out;
}

// Mean luminance by class of path, of the chains.
std::map<uint64_t, double> class_energy(const Render& render) {
    return render.metropolis_statistics().energy(render.film().scale(),
                                                 render.metropolis()->mutations_per_unit());
}

// Of the chains, by name.
py::dict metropolis_stats(const Render& render) {
    const MetropolisStatistics& s = render.metropolis_statistics();
    const MetropolisPlan& plan = *render.metropolis();
    const double scale = render.film().scale();
    const auto rate = [](double n, double t) { return t > 0 ? n / t : 0; };
    py::dict out, mutations, classes;
    double total = 0;
    for (const double w : plan.mutation_weights) total += w;
    for (int m = 0; m < mutation_count; ++m) {
        const MutationCounts& c = s.chains.mutations[size_t(m)];
        py::dict row;
        row["weight"] = plan.mutation_weights[size_t(m)] / total;
        row["applicable"] = c.applicable;
        row["proposed"] = c.proposed;
        row["made"] = c.made;
        row["accepted"] = c.accepted;
        row["mean_acceptance"] =
            rate(double(c.acceptance) / MutationCounts::unit, double(c.proposed));
        mutations[py::str(std::string(mutation_name(m)))] = row;
    }
    for (const auto& [key, energy] : class_energy(render))
        classes[py::str(key == 0 ? "other" : class_name(key))] = energy;
    out["mutations"] = s.chains.steps;
    out["mutations_per_second"] = rate(double(s.chains.steps), render.seconds());
    out["mutations_per_cpu_second"] = rate(double(s.chains.steps), render.cpu_seconds());
    out["b"] = s.b(scale);
    out["b_error"] = s.b_error(scale);
    out["bootstrap_samples"] = s.bootstrap_samples;
    out["bootstrap_rays"] = s.bootstrap_rays;
    out["pilot_rays"] = plan.pilot_rays;
    out["direct"] = plan.direct_separately ? "separate" : "mlt";
    out["share_of_bidirectional_samples"] = 1 - rate(double(plan.mutations_per_unit()), plan.work);
    // Of the others, by the pilot: what `auto` decides by.
    out["error_relative_to_bdpt"] = plan.relative_error;
    out["path_error"] = std::vector<double>{plan.others.path, plan.others.path_notes};
    out["bdpt_error"] =
        std::vector<double>{plan.others.bidirectional, plan.others.bidirectional_notes};
    out["chains"] = s.units * uint64_t(plan.chains);
    out["longest_rejection"] = s.chains.longest_rejection;
    out["mutation"] = mutations;
    out["path_class_energy"] = classes;
    return out;
}

// Mean luminance by path length: that of camera samples, and that of the chains.
std::vector<double> path_length_energy(const Render& render) {
    std::vector<double> energy = render.statistics().energy(render.film().scale());
    if (render.metropolis())
        for (const auto& [key, value] : class_energy(render))
            if (key != 0) energy[size_t(edges_of_class(key))] += value;
    return energy;
}

py::dict stats(const Render& render) {
    const Statistics& s = render.statistics();
    const double seconds = render.seconds(), cpu = render.cpu_seconds();
    const auto rays = double(s.closest() + s.shadow());
    const auto rate = [](double n, double t) { return t > 0 ? n / t : 0; };
    py::dict out;
    out["samples"] = s.samples();
    out["rays"] = s.closest() + s.shadow();
    out["closest_rays"] = s.closest();
    out["shadow_rays"] = s.shadow();
    out["seconds"] = seconds;
    out["cpu_seconds"] = cpu;
    out["samples_per_second"] = rate(double(s.samples()), seconds);
    out["samples_per_cpu_second"] = rate(double(s.samples()), cpu);
    out["rays_per_second"] = rate(rays, seconds);
    out["rays_per_cpu_second"] = rate(rays, cpu);
    out["path_length_energy"] = path_length_energy(render);
    out["non_finite"] = s.non_finite();
    out["overflows"] = render.film().overflows();
    out["units_done"] = render.units_done();
    out["units_total"] = render.units_total();
    if (render.metropolis()) out["mlt"] = metropolis_stats(render);
    return out;
}

// Samples, or mutations, of a unit on average.
double samples_per_unit(const Render& render) {
    if (render.metropolis())
        return render.metropolis()->has_chains() ? render.metropolis()->work : 0;
    const Film& film = render.film();
    return double(film.width()) * film.height() * render.settings().samples /
           double(render.units_total());
}

}  // namespace

void bind_render(py::module_& module) {
    py::class_<Render>(module, "Render")
        .def(py::init([](std::shared_ptr<Scene> scene, const std::string& integrator, int samples,
                         int depth, uint64_t seed, const std::string& filter, int min_edges,
                         bool background, const std::string& direct, bool two_stage,
                         const std::map<std::string, double>& mutation_weights, bool error_layer,
                         int reduction, bool selective, const py::object& layers) {
                 Settings settings = make_settings(
                     integrator, samples, depth, seed, filter, min_edges, background, direct,
                     two_stage, mutation_weights, error_layer, reduction, selective);
                 settings.layers = automaton_from_python(*scene, layers);
                 const py::gil_scoped_release release;
                 return std::make_unique<Render>(std::move(scene), settings);
             }),
             py::arg("scene"), py::kw_only(), py::arg("integrator") = "path",
             py::arg("samples") = 64, py::arg("depth") = 16, py::arg("seed") = 0,
             py::arg("filter") = "gaussian", py::arg("min_edges") = 1, py::arg("background") = true,
             py::arg("direct") = "auto", py::arg("two_stage") = true,
             py::arg("mutation_weights") = std::map<std::string, double>(),
             py::arg("error_layer") = true, py::arg("reduction") = 1, py::arg("selective") = true,
             py::arg("layers") = py::none())
        .def_property_readonly("units_total", &Render::units_total)
        .def_property_readonly("units_done", &Render::units_done)
        .def_property_readonly(
            "units", [](const Render& render) { return render.units().ranges(); },
            "Which units are done: ranges (first, beyond the last), ascending.")
        .def_property_readonly(
            "film", [](Render& render) -> Film& { return render.film(); },
            py::return_value_policy::reference_internal)
        .def_property_readonly("development", &Render::development,
                               py::return_value_policy::reference_internal)
        .def_property_readonly("plan_digest", &Render::plan_digest,
                               "A number that tells plans apart, as 64 bits.")
        .def("saved", &saved, "Which units are done and what they counted, but for the film.")
        .def("add_saved", &add_saved, py::arg("saved"),
             "Adds what saved() of another render of the same plan returned; ValueError where "
             "units are done already. The film's sums are added to the film.")
        .def("clear", &Render::clear, "Back to the plan: no unit is done.")
        .def_property_readonly("samples_per_unit", &samples_per_unit,
                               "Samples, or mutations of mlt or their worth, on average.")
        .def("run", &run, py::arg("last_unit"), py::arg("threads") = 1,
             py::arg("deadline_seconds") = py::none(), py::arg("poll") = py::none(),
             py::arg("first_unit") = py::none(),
             "Renders units [first_unit, last_unit), none of which may be done, and returns n: "
             "[first_unit, n) are done. Without first_unit it goes on from the units 0, 1 ... that "
             "are done. poll(units_started) is called ten times a second; true, a signal or an "
             "exception stops handing out units, "
             "and those that were started are finished.")
        .def(
            "again",
            [](const Render& render, uint64_t seed, int samples) {
                if (samples < 1) throw std::invalid_argument("samples must be at least 1");
                return std::make_unique<Render>(render, seed, samples);
            },
            py::arg("seed"), py::arg("samples"),
            "A render by the same plan with other random numbers, and without an error layer.")
        .def("image", &image, "Linear premultiplied RGBA, (height, width, 4) float32.")
        .def("error", &error, "Standard error of the image's luminance, (height, width) float32.")
        .def("layer", &layer, py::arg("index"),
             "A layer of light paths, (height, width, 3) float32.")
        .def("stats", &stats)
        .def(
            "replay_rays_per_cpu_second",
            [](const Render& render, size_t count) {
                const py::gil_scoped_release release;
                const RayRecorder rays = render.record_rays(count);
                const double seconds = replay_rays(render.scene(), rays);
                return seconds > 0 ? double(rays.entries.size()) / seconds : 0;
            },
            py::arg("count") = 1000000,
            "Rays per CPU-second of Embree alone, replaying the render's first rays.");
}

}  // namespace usdmlt
