#include "python/bind_surfaces.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <cmath>

#include "python/arrays.hpp"
#include "surfaces/limit.hpp"
#include "surfaces/triangulation.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

using namespace surfaces;

using Indices = py::array_t<int32_t, py::array::c_style | py::array::forcecast>;
using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Flags = py::array_t<bool, py::array::c_style | py::array::forcecast>;

template <class T, int Options>
std::span<const T> all_of(const py::array_t<T, Options>& array) {
    return {array.data(), static_cast<size_t>(array.size())};
}

Polygons polygons(const Floats& points, const Indices& counts, const Indices& indices) {
    if (points.ndim() != 2 || points.shape(1) != 3)
        throw std::invalid_argument("points must be (n, 3)");
    return {{reinterpret_cast<const Vec3f*>(points.data()), static_cast<size_t>(points.shape(0))},
            all_of(counts),
            all_of(indices)};
}

py::tuple triangulated(const Floats& points, const Indices& counts, const Indices& indices) {
    const Polygons authored = polygons(points, counts, indices);
    if (!authored.are_sound()) throw std::invalid_argument("polygons that contradict each other");
    Triangulation out = triangulate(authored);
    return py::make_tuple(to_array<int32_t>(std::move(out.corners)),
                          to_array<int32_t>(std::move(out.faces)));
}

py::object visible(const Floats& points, const Indices& counts, const Indices& indices,
                   bool left_handed, const Flags& holes) {
    const Polygons authored = polygons(points, counts, indices);
    if (!authored.are_sound()) return py::none();
    if (holes.size() != 0 && holes.size() != counts.size())
        throw std::invalid_argument("holes must be (faces,), or empty");
    VisibleTriangles out = visible_triangles(authored, left_handed, all_of(holes));
    if (out.as_authored) return py::make_tuple(py::none(), py::none(), py::none(), 0);
    return py::make_tuple(to_array<int32_t>(std::move(out.vertices)),
                          to_array<int32_t>(std::move(out.triangulation.corners)),
                          to_array<int32_t>(std::move(out.triangulation.faces)), out.flat);
}

// The faces of a cage: those of at least three sides, none of which runs from a vertex to itself.
// Their corners and numbers, and how many sides they have.
py::tuple usable_faces(const Indices& counts, const Indices& indices) {
    std::vector<int32_t> corners, faces, sides;
    const auto all = all_of(indices);
    int32_t start = 0;
    for (py::ssize_t face = 0; face < counts.size(); ++face) {
        const int32_t n = counts.at(face);
        bool good = n >= 3;
        for (int32_t i = 0; good && i < n; ++i) good = all[start + i] != all[start + (i + 1) % n];
        if (good) {
            for (int32_t i = 0; i < n; ++i) corners.push_back(start + i);
            faces.push_back(static_cast<int32_t>(face));
            sides.push_back(n);
        }
        start += n;
    }
    return py::make_tuple(to_array<int32_t>(std::move(corners)),
                          to_array<int32_t>(std::move(faces)), to_array<int32_t>(std::move(sides)));
}

Cage new_cage(const Indices& counts, const Indices& indices, int32_t vertex_count) {
    for (const int32_t v : all_of(indices))
        if (v < 0 || v >= vertex_count) throw std::invalid_argument("a vertex out of range");
    int64_t corners = 0;
    for (const int32_t n : all_of(counts)) {
        if (n < 3) throw std::invalid_argument("a face of fewer than three sides");
        corners += n;
    }
    if (corners != indices.size()) throw std::invalid_argument("counts do not add up");
    return build_cage(all_of(counts), all_of(indices), vertex_count);
}

Scheme scheme_of(const std::string& name) {
    if (name == "catmullClark") return Scheme::catmull_clark;
    if (name == "loop") return Scheme::loop;
    if (name == "bilinear") return Scheme::bilinear;
    throw std::invalid_argument("no scheme: " + name);
}

const Doubles& rows(const Doubles& values, int32_t count) {
    if (values.ndim() != 2 || values.shape(0) != count)
        throw std::invalid_argument("values must be (" + std::to_string(count) + ", width)");
    return values;
}

py::array_t<double> refined_values(const Refinement& refinement, const Doubles& values) {
    const auto width = static_cast<int>(rows(values, refinement.coarse_count).shape(1));
    py::array_t<double> out({py::ssize_t(refinement.count()), py::ssize_t(width)});
    refinement.apply(values.data(), width, out.mutable_data());
    return out;
}

// Stencils whose columns are the vertices of a cage.
struct Masks {
    Stencils stencils;
    int32_t columns;
};

py::array_t<double> masked_values(const Masks& masks, const Doubles& values) {
    const auto width = static_cast<int>(rows(values, masks.columns).shape(1));
    py::array_t<double> out({py::ssize_t(masks.stencils.count), py::ssize_t(width)});
    std::fill_n(out.mutable_data(), out.size(), 0.0);
    masks.stencils.apply(values.data(), width, out.mutable_data());
    return out;
}

py::tuple refined(const Cage& cage, const std::string& scheme, bool smooth_triangles) {
    Refined out = refine(cage, scheme_of(scheme), smooth_triangles);
    return py::make_tuple(std::move(out.cage), std::move(out.refinement));
}

py::tuple value_cage(const Cage& cage, const Indices& counts, const Indices& values,
                     const std::string& rule) {
    if (values.size() != cage.corner_count() || counts.size() != cage.face_count)
        throw std::invalid_argument("a value per corner and a count per face are needed");
    ValueCage out = face_varying_cage(cage, all_of(counts), all_of(values), rule);
    return py::make_tuple(std::move(out.cage), to_array<int32_t>(std::move(out.chosen)));
}

py::tuple triangles(const Cage& cage, bool left_handed, const Flags& hidden) {
    CageTriangles out = cage_triangles(cage, left_handed, all_of(hidden));
    return py::make_tuple(to_array<int32_t>(std::move(out.corners)),
                          to_array<int32_t>(std::move(out.vertices)),
                          to_array<int32_t>(std::move(out.root_faces)));
}

py::tuple normals(const Cage& cage, const std::string& scheme, const Doubles& vertices,
                  const Doubles& limit) {
    const auto points = [&](const Doubles& array) {
        if (rows(array, cage.vertex_count).shape(1) != 3)
            throw std::invalid_argument("vertices must be (n, 3)");
        return reinterpret_cast<const Vec3d*>(array.data());
    };
    Normals out = limit_normals(cage, scheme_of(scheme), points(vertices), points(limit));
    return py::make_tuple(to_array<double>(std::move(out.values)),
                          to_array<int32_t>(std::move(out.of_corner)));
}

py::tuple sectors(const Cage& cage) {
    Sectors out = find_sectors(cage);
    return py::make_tuple(
        to_array<int32_t>(std::move(out.sector)), to_array<int32_t>(std::move(out.position)),
        to_array<int32_t>(std::move(out.size)), to_array<uint8_t>(std::move(out.closed)));
}

py::tuple sector_tangents(const Cage& cage, const std::string& scheme) {
    Tangents out = tangents(cage, scheme_of(scheme), find_sectors(cage));
    return py::make_tuple(Masks{std::move(out.along), cage.vertex_count},
                          Masks{std::move(out.across), cage.vertex_count});
}

// The root mean square length of a cage's edges in a picture. A length l at distance d from `eye`
// has l / (pixel · max(d, l/2)) pixels; without an eye, l / pixel anywhere.
double edge_pixels(const Cage& cage, const Floats& points, const Doubles& transform,
                   const std::optional<std::array<double, 3>>& eye, double pixel) {
    if (points.ndim() != 2 || points.shape(0) != cage.vertex_count || points.shape(1) != 3 ||
        transform.size() != 16)
        throw std::invalid_argument("points must be (vertices, 3), the transform (4, 4)");
    const double* m = transform.data();
    const auto place = [&](int32_t v) {
        const float* p = points.data() + 3 * size_t(v);
        const auto axis = [&](int i) {
            return p[0] * m[i] + p[1] * m[4 + i] + p[2] * m[8 + i] + m[12 + i];
        };
        return Vec3d{axis(0), axis(1), axis(2)};
    };
    double sum = 0;
    int64_t count = 0;
    for (const auto& [start, end] : cage.edge_vertices) {
        const Vec3d a = place(start), b = place(end);
        const double l = length(b - a);
        double size = pixel;
        if (eye) {
            const Vec3d from{(*eye)[0], (*eye)[1], (*eye)[2]};
            size *= std::max(length((a + b) * 0.5 - from), l / 2);
        }
        if (!(size > 0)) continue;
        sum += sqr(l / size);
        ++count;
    }
    return count > 0 ? std::sqrt(sum / double(count)) : 0;
}

void bind_cage(py::module_& module) {
    const auto indices = [](std::vector<int32_t> Cage::* member) {
        return [member](const py::object& self) {
            return view<int32_t>(self.cast<const Cage&>().*member, self);
        };
    };
    const auto sharpness = [](std::vector<double> Cage::* member) {
        return [member](const py::object& self) {
            return view<double>(self.cast<const Cage&>().*member, self);
        };
    };
    py::class_<Cage>(
        module, "Cage",
        "Polygons as corners (positions in faceVertexIndices), and their edges. Corner "
        "c of face corner_faces[c] is at vertex corner_vertices[c]; following[c] and "
        "preceding[c] are its neighbours in the face; corner_edges[c] is the edge to "
        "the following one. edge_vertices (edges, 2); the sharpness of edges, infinite "
        "on boundaries, and vertices can be written to.")
        .def(py::init(&new_cage), py::arg("counts"), py::arg("indices"), py::arg("vertex_count"))
        .def_readonly("vertex_count", &Cage::vertex_count)
        .def_readonly("face_count", &Cage::face_count)
        .def_property_readonly("corner_count", &Cage::corner_count)
        .def_property_readonly("edge_count", &Cage::edge_count)
        .def_property_readonly("corner_vertices", indices(&Cage::corner_vertices))
        .def_property_readonly("corner_faces", indices(&Cage::corner_faces))
        .def_property_readonly("following", indices(&Cage::following))
        .def_property_readonly("preceding", indices(&Cage::preceding))
        .def_property_readonly("corner_edges", indices(&Cage::corner_edges))
        .def_property_readonly("edge_vertices",
                               [](const py::object& self) {
                                   return view<int32_t>(self.cast<const Cage&>().edge_vertices,
                                                        self);
                               })
        .def_property_readonly("edge_sharpness", sharpness(&Cage::edge_sharpness))
        .def_property_readonly("vertex_sharpness", sharpness(&Cage::vertex_sharpness))
        .def("find_edge", &find_edge, py::arg("a"), py::arg("b"),
             "The edge between two vertices; -1 if there is none.")
        .def("edge_pixels", &edge_pixels, py::arg("points"), py::arg("transform"), py::arg("eye"),
             py::arg("pixel"), "The root mean square length of the edges in a picture.")
        .def("triangles", &triangles, py::arg("left_handed"), py::arg("hidden"),
             "Two triangles for each quadrilateral: their corners and vertices, (n, 3), and the "
             "faces of the coarsest cage that they are from. hidden: of these, which to leave out; "
             "or empty.");
}

}  // namespace

void bind_surfaces(py::module_& module) {
    py::module_ sub = module.def_submodule("surfaces", "Polygons and subdivision surfaces.");
    sub.attr("INFINITE") = infinite_sharpness;
    sub.def("triangulate", &triangulated, py::arg("points"), py::arg("counts"), py::arg("indices"),
            "Polygons, points (n, 3), into triangles: their corners (m, 3), positions in indices, "
            "in the winding of the faces, and their faces (m,).");
    sub.def("visible_triangles", &visible, py::arg("points"), py::arg("counts"), py::arg("indices"),
            py::arg("left_handed"), py::arg("holes"),
            "The triangles of polygons that have an area and are in no hole (faces,), "
            "counter-clockwise seen from outside: their points and corners (m, 3) and faces (m,), "
            "each None where all faces are triangles and all of them are there; and how many have "
            "no area. None for points that are not finite, counts that do not add up and indices "
            "out of range.");
    sub.def("usable_faces", &usable_faces, py::arg("counts"), py::arg("indices"),
            "The faces of at least three sides, none of which runs from a vertex to itself: their "
            "corners, their numbers, and how many sides they have.");

    bind_cage(sub);
    py::class_<Refinement>(sub, "Refinement",
                           "(finer vertices, width) float64 from (coarser vertices, width).")
        .def("__call__", &refined_values, py::arg("values"));
    py::class_<Masks>(sub, "Masks", "(rows, width) float64 from (vertices, width).")
        .def("__call__", &masked_values, py::arg("values"));
    sub.def("refine", &refined, py::arg("cage"), py::arg("scheme"),
            py::arg("smooth_triangles") = false, "One level: the finer cage and its Refinement.");
    sub.def(
        "linear_refinement",
        [](const Cage& cage, const std::string& scheme) {
            return linear_refinement(cage, scheme_of(scheme));
        },
        py::arg("cage"), py::arg("scheme"),
        "Linear interpolation to the vertices that a scheme's refinement makes.");
    sub.def(
        "limit_positions",
        [](const Cage& cage, const std::string& scheme) {
            return Masks{limit_positions(cage, scheme_of(scheme)), cage.vertex_count};
        },
        py::arg("cage"), py::arg("scheme"),
        "From the vertices of a cage of quadrilaterals (loop: triangles) to the limit surface.");
    sub.def("limit_normals", &normals, py::arg("cage"), py::arg("scheme"), py::arg("vertices"),
            py::arg("limit"), "Unit normals (n, 3), and which of them each corner has.");
    sub.def("find_sectors", &sectors, py::arg("cage"),
            "The corners around vertices, apart where creases divide them: of each corner its "
            "sector and position there; of each sector its size and whether it is closed.");
    sub.def("sector_tangents", &sector_tangents, py::arg("cage"), py::arg("scheme"),
            "Two tangents per sector, along and across creases, as Masks.");
    sub.def("face_varying_cage", &value_cage, py::arg("cage"), py::arg("counts"), py::arg("values"),
            py::arg("rule"),
            "The cage whose vertices are the distinct values at each vertex, by "
            "faceVaryingLinearInterpolation, and which value each of them has.");
}

}  // namespace usdmlt
