#include "python/bind_metropolis.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "integrators/grid_target.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

using Grid = py::array_t<double, py::array::c_style | py::array::forcecast>;

py::dict plain_metropolis(const Grid& f, const std::vector<double>& weights, int64_t chains,
                          int64_t steps, uint64_t seed, double smallest_step, double largest_step,
                          bool forget_density) {
    if (f.ndim() != 2) throw std::invalid_argument("f is a 2-D array");
    if (weights.size() != GridTarget::mutation_count)
        throw std::invalid_argument("one weight per mutation");
    const std::span<const double> values(f.data(), static_cast<size_t>(f.size()));
    const auto width = static_cast<size_t>(f.shape(1));
    ChainCounts counts(GridTarget::mutation_count);
    Grid histogram({f.shape(0), f.shape(1)});
    double* cells = histogram.mutable_data();
    {
        const py::gil_scoped_release release;
        GridTarget target(values, width, smallest_step, largest_step);
        target.forget_density = forget_density;
        counts = run_plain_metropolis(target, values, width, MutationSelection(weights), chains,
                                      steps, seed);
        std::copy(target.histogram.begin(), target.histogram.end(), cells);
    }
    py::dict acceptance, out;
    for (int m = 0; m < GridTarget::mutation_count; ++m) {
        const MutationCounts& c = counts.mutations[size_t(m)];
        if (c.proposed > 0)
            acceptance[GridTarget::names[m]] =
                double(c.acceptance) / MutationCounts::unit / double(c.proposed);
    }
    out["histogram"] = histogram;
    out["acceptance"] = acceptance;
    return out;
}

}  // namespace

void bind_metropolis(py::module_& module) {
    py::list names;
    for (const char* name : GridTarget::names) names.append(name);
    module.attr("plain_mutations") = py::tuple(names);
    module.def("plain_metropolis", &plain_metropolis, py::arg("f"), py::kw_only(),
               py::arg("weights"), py::arg("chains"), py::arg("steps"), py::arg("seed"),
               py::arg("smallest_step"), py::arg("largest_step"), py::arg("forget_density") = false,
               "Histogram and acceptance of chains with target f; see usdmlt.metropolis. "
               "forget_density makes the acceptance wrong, for tests of the tests.");
}

}  // namespace usdmlt
