#include "python/bind_film.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <map>

#include "film/development.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

using Sums = py::array_t<int64_t, py::array::c_style | py::array::forcecast>;

// Views of the film's own memory, which Python may read.
std::map<std::string, py::array> planes(const py::object& self) {
    std::map<std::string, py::array> out;
    for (const Film::Plane& plane : self.cast<Film&>().planes()) {
        py::array_t<int64_t> view(plane.shape, plane.sums->data(), self);
        view.attr("setflags")(py::arg("write") = false);
        out[plane.name] = view;
    }
    return out;
}

void add(Film& film, const std::map<std::string, Sums>& sums) {
    const std::vector<Film::Plane> planes = film.planes();
    if (sums.size() != planes.size()) throw std::invalid_argument("the sums of another film");
    for (const Film::Plane& plane : planes) {
        const auto found = sums.find(plane.name);
        if (found == sums.end() ||
            !std::equal(plane.shape.begin(), plane.shape.end(), found->second.shape(),
                        found->second.shape() + found->second.ndim(),
                        [](size_t a, py::ssize_t b) { return py::ssize_t(a) == b; }))
            throw std::invalid_argument("the film's " + plane.name + " have another shape");
    }
    const py::gil_scoped_release release;
    for (const Film::Plane& plane : planes)
        film.add_sums(plane, sums.find(plane.name)->second.data());
}

UnitSet units_of(const std::vector<UnitSet::Range>& ranges) {
    UnitSet units;
    for (const UnitSet::Range& range : ranges) {
        if (units.overlaps(range)) throw std::invalid_argument("ranges of units overlap");
        units.add(range);
    }
    return units;
}

py::array_t<float> image(const Development& development, const Film& film,
                         const std::vector<UnitSet::Range>& units) {
    py::array_t<float> out({film.height(), film.width(), 4});
    development.picture(film, units_of(units), out.mutable_data());
    return out;
}

py::array_t<float> error(const Development& development, const Film& film,
                         const std::vector<UnitSet::Range>& units) {
    py::array_t<float> out({film.height(), film.width()});
    development.error(film, units_of(units), out.mutable_data());
    return out;
}

py::array_t<float> layer(const Development& development, const Film& film,
                         const std::vector<UnitSet::Range>& units, int index) {
    if (index < 0 || index >= film.layers()) throw py::index_error("no such layer");
    py::array_t<float> out({film.height(), film.width(), 3});
    development.layer(film, units_of(units), index, out.mutable_data());
    return out;
}

py::array_t<uint32_t> sample_counts(const Film& film) {
    py::array_t<uint32_t> out({film.height(), film.width()});
    for (size_t i = 0; i < size_t(out.size()); ++i)
        out.mutable_data()[i] = static_cast<uint32_t>(film.sample_count(i));
    return out;
}

}  // namespace

void bind_film(py::module_& module) {
    py::class_<Film>(module, "Film")
        .def(py::init<int, int, double, double, bool, bool, int>(), py::arg("width"),
             py::arg("height"), py::arg("scale"), py::arg("sample_weight"), py::arg("splats"),
             py::arg("error"), py::arg("layers"))
        .def_property_readonly("scale", &Film::scale)
        .def_property_readonly("sample_weight", &Film::sample_weight)
        .def_property_readonly("has_splats", &Film::has_splats)
        .def_property_readonly("has_error", &Film::has_error)
        .def_property_readonly("layers", &Film::layers)
        .def_property_readonly("overflows", &Film::overflows)
        .def("planes", &planes,
             "Its sums by name, int64, rows first, as views that change while units run.")
        .def("add", &add, py::arg("sums"),
             "Adds the planes of a film of the same size; ValueError where it is of another.")
        .def("sample_counts", &sample_counts, "Camera samples by pixel, (height, width) uint32.");
    py::class_<Development>(module, "Development")
        .def(py::init<int64_t, double>(), py::arg("mutations_per_unit"), py::arg("exposure"))
        .def_readonly("mutations_per_unit", &Development::mutations_per_unit)
        .def_readonly("exposure", &Development::exposure)
        .def("image", &image, py::arg("film"), py::arg("units"),
             "Linear premultiplied RGBA of a film with these units, (height, width, 4) float32.")
        .def("error", &error, py::arg("film"), py::arg("units"),
             "Standard error of the image's luminance, (height, width) float32.")
        .def("layer", &layer, py::arg("film"), py::arg("units"), py::arg("index"),
             "A layer of light paths, (height, width, 3) float32.");
}

}  // namespace usdmlt
