#include "python/bind_materials.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <stdexcept>

#include "materials/nodes.hpp"
#include "python/arrays.hpp"

namespace usdmlt {

namespace py = pybind11;

namespace {

using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;

template <typename Value>
Value choose(const std::map<std::string, Value>& values, const std::string& key) {
    const auto it = values.find(key);
    if (it == values.end()) throw std::invalid_argument("unknown name '" + key + "'");
    return it->second;
}

Wrap wrap_from_python(const py::handle& name) {
    static const std::map<std::string, Wrap> wraps = {{"black", Wrap::black},
                                                      {"clamp", Wrap::clamp},
                                                      {"repeat", Wrap::repeat},
                                                      {"mirror", Wrap::mirror}};
    return choose(wraps, py::cast<std::string>(name));
}

Texture texture_from_python(const py::handle& source) {
    using Depth = Texture::Depth;
    Texture texture;
    texture.name = py::cast<std::string>(source.attr("name"));
    texture.wrap_s = wrap_from_python(source.attr("wrap_s"));
    texture.wrap_t = wrap_from_python(source.attr("wrap_t"));
    const auto fail = [&](const std::string& what) {
        throw std::invalid_argument("texture '" + texture.name + "' " + what);
    };
    auto pixels = py::array::ensure(source.attr("pixels"), py::array::c_style);
    if (!pixels || pixels.ndim() != 3 || pixels.shape(2) < 1 || pixels.shape(2) > 4 ||
        pixels.size() == 0)
        fail("is not (height, width, 1 to 4 channels)");
    const char kind = pixels.dtype().kind();
    const auto size = pixels.itemsize();
    if (kind == 'u' && size == 1) {
        texture.depth = Depth::byte;
    } else if (kind == 'u' && size == 2) {
        texture.depth = Depth::word;
    } else if (kind == 'f' && size == 2) {
        texture.depth = Depth::half;
    } else {
        texture.depth = Depth::single;
        pixels = FloatArray::ensure(pixels);
        if (!pixels) fail("is not of numbers");
    }
    texture.width = int(pixels.shape(1));
    texture.height = int(pixels.shape(0));
    texture.channels = int(pixels.shape(2));
    texture.pixels = share<void>(std::move(pixels));
    if (const py::object curve = source.attr("decode"); !curve.is_none()) {
        auto decode = FloatArray::ensure(curve);
        const py::ssize_t count = texture.depth == Depth::byte   ? 256
                                  : texture.depth == Depth::word ? 65536
                                                                 : 0;
        if (!decode || count == 0 || decode.size() != count)
            fail("has a curve that does not fit its pixels");
        texture.decode = share<float>(std::move(decode));
    }
    if (const py::object matrix = source.attr("matrix"); !matrix.is_none()) {
        const auto values = FloatArray::ensure(matrix);
        if (!values || values.size() != 9) fail("has a matrix that is not (3, 3)");
        texture.has_matrix = true;
        std::copy_n(values.data(), 9, texture.matrix.begin());
    }
    return texture;
}

// The pattern program of a compiled material: values in order, each a constant or a node of values
// before it; the forms are listed in closures.py. The operand of each value.
std::vector<Operand> program_from_python(const py::handle& compiled,
                                         const std::vector<Texture>& textures, Program& program) {
    for (const py::handle set : compiled["tile_sets"]) {
        TileSet tiles;
        for (const py::handle tile : set) {
            const auto [number, texture] = py::cast<std::pair<uint32_t, uint32_t>>(tile);
            tiles.tiles.push_back({number, texture});
        }
        program.tile_sets.push_back(std::move(tiles));
    }
    std::vector<Operand> operands;
    for (const py::handle value : compiled["values"]) {
        const auto fields = py::cast<py::tuple>(value);
        if (!py::isinstance<py::str>(fields[0])) {
            const auto v = py::cast<std::array<float, 4>>(fields);
            operands.push_back(program.constant({{v[0], v[1], v[2], v[3]}}));
            continue;
        }
        std::vector<Operand> inputs;
        for (const auto i : py::cast<std::vector<size_t>>(fields[3]))
            inputs.push_back(operands.at(i));
        operands.push_back(program.node(py::cast<std::string>(fields[0]), py::cast<int>(fields[1]),
                                        py::cast<uint32_t>(fields[2]), inputs, textures));
    }
    return operands;
}

Material material_from_python(const py::handle& source, const std::vector<Texture>& textures) {
    static const std::map<std::string, OperationType> types = {
        {"diffuse", OperationType::diffuse},
        {"eon", OperationType::eon},
        {"translucent", OperationType::translucent},
        {"dielectric", OperationType::dielectric},
        {"conductor", OperationType::conductor},
        {"schlick", OperationType::schlick},
        {"sheen", OperationType::sheen},
        {"emission", OperationType::emission},
        {"preview_surface", OperationType::preview_surface},
        {"layer", OperationType::layer},
        {"mix", OperationType::mix},
        {"add", OperationType::add},
        {"multiply", OperationType::multiply}};
    Material material;
    material.name = py::cast<std::string>(source["name"]);
    std::vector<Operand> values;
    try {
        values = program_from_python(source, textures, material.program);
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument("material '" + material.name + "' " + error.what());
    }
    const auto operand = [&](const py::handle& value) {
        return values.at(py::cast<size_t>(value));
    };
    for (const py::handle operation : source["operations"]) {
        Operation op{};
        op.type = choose(types, py::cast<std::string>(operation["type"]));
        const auto mode = py::cast<std::string>(operation["scatter_mode"]);
        op.reflects = mode.find('R') != std::string::npos;
        op.transmits = mode.find('T') != std::string::npos;
        op.specular_workflow = py::cast<bool>(operation["specular_workflow"]);
        op.parameter = uint32_t(material.parameters.size());
        for (const py::handle parameter : operation["parameters"])
            material.parameters.push_back(operand(parameter));
        material.operations.push_back(op);
    }
    material.opacity = operand(source["opacity"]);
    material.tangent_rotation = operand(source["tangent_rotation"]);
    material.thin_walled = py::cast<bool>(source["thin_walled"]);
    material.opacity_threshold = py::cast<float>(source["opacity_threshold"]);
    if (!source["normal"].is_none()) {
        material.has_normal_map = true;
        material.normal = operand(source["normal"]);
    }
    if (!source["tangent_primvar"].is_none())
        material.tangent_primvar = py::cast<uint32_t>(source["tangent_primvar"]);
    return material;
}

}  // namespace

Materials materials_from_python(const py::list& textures, const py::list& compiled_materials) {
    Materials materials;
    for (const py::handle texture : textures)
        materials.textures.push_back(texture_from_python(texture));
    for (const py::handle material : compiled_materials) {
        materials.materials.push_back(material_from_python(material, materials.textures));
        finish_material(materials, uint32_t(materials.materials.size() - 1));
    }
    return materials;
}

namespace {

Vec3f vector_from_python(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

// (n, 3) rows.
class Directions {
public:
    explicit Directions(const FloatArray& array) : array_(array) {
        if (array.ndim() != 2 || array.shape(1) != 3)
            throw std::invalid_argument("directions are an (n, 3) array");
    }
    py::ssize_t size() const { return array_.shape(0); }
    Vec3f operator[](py::ssize_t i) const {
        return {array_.at(i, 0), array_.at(i, 1), array_.at(i, 2)};
    }

private:
    FloatArray array_;
};

void require_same_length(py::ssize_t a, py::ssize_t b) {
    if (a != b) throw std::invalid_argument("the arrays differ in length");
}

Known role_from_python(const std::string& role) {
    return choose<Known>({{"eye", Known::eye}, {"light", Known::light}}, role);
}

// The closure of one material at a point of a one-triangle mesh, over arrays of directions.
class ClosureProbe {
public:
    ClosureProbe(const py::list& textures, const py::dict& compiled_material,
                 const std::array<float, 3>& shading_normal,
                 const std::array<float, 3>& geometric_normal, const std::array<float, 3>& tangent,
                 const std::map<uint32_t, FloatArray>& primvars,
                 const std::array<float, 2>& barycentrics, bool mirrored) {
        py::list compiled;
        compiled.append(compiled_material);
        materials_ = materials_from_python(textures, compiled);
        mesh_.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
        mesh_.triangles = std::vector<Triangle>{{{0, 1, 2}}};
        for (const auto& [slot, values] : primvars) {
            if (values.ndim() != 2 || values.shape(0) != 3 || values.shape(1) > 4)
                throw std::invalid_argument("a primvar has 3 rows of at most 4 numbers");
            if (slot >= mesh_.primvars.size()) mesh_.primvars.resize(slot + 1);
            mesh_.primvars[slot].width = int(values.shape(1));
            mesh_.primvars[slot].values =
                std::vector<float>(values.data(), values.data() + values.size());
        }
        b1_ = barycentrics[0];
        b2_ = barycentrics[1];
        closure_.shading = Frame::from_normal(vector_from_python(shading_normal));
        closure_.geometric_normal = vector_from_python(geometric_normal);
        evaluate_material(materials_, 0, mesh_, 0, b1_, b2_, vector_from_python(tangent), closure_,
                          mirrored);
    }

    FloatArray evaluate(const FloatArray& to_light, const FloatArray& to_eye,
                        Component component) const {
        const Directions l(to_light), e(to_eye);
        require_same_length(l.size(), e.size());
        FloatArray values({l.size(), py::ssize_t(3)});
        for (py::ssize_t i = 0; i < l.size(); ++i) {
            const Spectrum f = closure_.evaluate(l[i], e[i], component);
            for (int k = 0; k < 3; ++k) values.mutable_at(i, k) = f[k];
        }
        return values;
    }

    FloatArray pdf(const FloatArray& known, const FloatArray& sampled, const std::string& role,
                   Component component) const {
        const Directions k(known), s(sampled);
        require_same_length(k.size(), s.size());
        const Known known_role = role_from_python(role);
        FloatArray densities(k.size());
        for (py::ssize_t i = 0; i < k.size(); ++i)
            densities.mutable_at(i) = closure_.pdf(k[i], s[i], known_role, component);
        return densities;
    }

    py::tuple sample(const FloatArray& known, const std::string& role, const FloatArray& u_lobe,
                     const FloatArray& u) const {
        const Directions k(known);
        const py::ssize_t n = k.size();
        require_same_length(n, u_lobe.size());
        require_same_length(2 * n, u.size());
        FloatArray directions({n, py::ssize_t(3)}), values({n, py::ssize_t(3)}), densities(n);
        py::array_t<uint8_t> components(n);
        py::array_t<bool> valid(n);
        const Known known_role = role_from_python(role);
        for (py::ssize_t i = 0; i < n; ++i) {
            ClosureSample s;
            valid.mutable_at(i) = closure_.sample(k[i], known_role, u_lobe.data()[i],
                                                  {u.data()[2 * i], u.data()[2 * i + 1]}, s);
            const float d[3] = {s.direction.x, s.direction.y, s.direction.z};
            for (int c = 0; c < 3; ++c) {
                directions.mutable_at(i, c) = d[c];
                values.mutable_at(i, c) = s.value[c];
            }
            densities.mutable_at(i) = s.pdf;
            components.mutable_at(i) = s.component;
        }
        return py::make_tuple(directions, values, densities, components, valid);
    }

    FloatArray eta_of_side(const FloatArray& directions, Component component) const {
        const Directions d(directions);
        FloatArray etas(d.size());
        for (py::ssize_t i = 0; i < d.size(); ++i)
            etas.mutable_at(i) = closure_.eta_of_side(d[i], component);
        return etas;
    }

    std::array<float, 3> emitted() const { return to_array(closure_.emission); }
    std::array<float, 3> emission_alone() const {
        return to_array(emission(materials_, 0, mesh_, 0, b1_, b2_));
    }
    float opacity_here() const { return opacity(materials_, 0, mesh_, 0, b1_, b2_); }
    bool has_non_delta() const { return closure_.has_non_delta; }
    bool emissive() const { return is_emissive(materials_, 0); }
    bool opaque() const { return is_opaque(materials_, 0); }
    std::array<float, 3> shading_normal() const {
        const Vec3f n = closure_.shading.z;
        return {n.x, n.y, n.z};
    }
    std::array<float, 3> shading_tangent() const {
        const Vec3f t = closure_.shading.x;
        return {t.x, t.y, t.z};
    }

    py::list lobes() const {
        static const char* const names[] = {"diffuse", "translucent", "dielectric", "conductor",
                                            "schlick", "eon",         "sheen"};
        py::list list;
        for (int i = 0; i < closure_.lobe_count; ++i) {
            const Lobe& lobe = closure_.lobes[i];
            py::dict d;
            d["type"] = names[static_cast<int>(lobe.type)];
            d["reflects"] = lobe.reflects;
            d["transmits"] = lobe.transmits;
            d["delta"] = lobe.delta;
            d["alpha"] = py::make_tuple(lobe.alpha_x, lobe.alpha_y);
            d["eta"] = lobe.eta;
            d["exponent"] = lobe.exponent;
            d["weight"] = to_array(lobe.weight);
            d["color0"] = to_array(lobe.color0);
            d["color90"] = to_array(lobe.color90);
            list.append(d);
        }
        return list;
    }

private:
    static std::array<float, 3> to_array(const Spectrum& s) { return {s[0], s[1], s[2]}; }

    Materials materials_;
    Mesh mesh_;
    float b1_ = 0, b2_ = 0;
    Closure closure_;
};

std::array<float, 3> tangent_of_triangle(const FloatArray& points, const FloatArray& st) {
    if (points.size() != 9 || st.size() != 6)
        throw std::invalid_argument("a triangle has (3, 3) points and (3, 2) coordinates");
    Mesh mesh;
    for (int i = 0; i < 3; ++i)
        mesh.positions.push_back(
            {points.data()[3 * i], points.data()[3 * i + 1], points.data()[3 * i + 2]});
    mesh.triangles = std::vector<Triangle>{{{0, 1, 2}}};
    mesh.primvars.resize(1);
    mesh.primvars[0].width = 2;
    mesh.primvars[0].values = std::vector<float>(st.data(), st.data() + 6);
    const Vec3f t = tangent_along_s(mesh, 0, 0);
    return {t.x, t.y, t.z};
}

FloatArray lookup_texture(const py::object& source, const FloatArray& st) {
    if (st.ndim() != 2 || st.shape(1) != 2)
        throw std::invalid_argument("texture coordinates are an (n, 2) array");
    const Texture texture = texture_from_python(source);
    FloatArray texels({st.shape(0), py::ssize_t(4)});
    for (py::ssize_t i = 0; i < st.shape(0); ++i) {
        const Texel t = texture.lookup({st.at(i, 0), st.at(i, 1)});
        for (int k = 0; k < 4; ++k) texels.mutable_at(i, k) = t[k];
    }
    return texels;
}

}  // namespace

void bind_materials(py::module_& module) {
    module.def("tangent_along_s", &tangent_of_triangle, py::arg("points"), py::arg("st"),
               "∂p/∂s of one triangle with (3, 3) points and (3, 2) texture coordinates.");
    module.def("lookup_texture", &lookup_texture, py::arg("texture"), py::arg("st"),
               "Bilinear lookups of a scene.Texture at (n, 2) coordinates: (n, 4) float32.");

    module.def("node_names", &node_names, "The nodes of pattern programs.");

    py::class_<ClosureProbe>(
        module, "ClosureProbe",
        "The closure of one compiled material at one point, for tests.\n\n"
        "Directions are (n, 3) unit vectors, float32. `primvars`: by slot, the\n"
        "three corners' values. `tangent`: along +s in world space, or zero.")
        .def(py::init<const py::list&, const py::dict&, const std::array<float, 3>&,
                      const std::array<float, 3>&, const std::array<float, 3>&,
                      const std::map<uint32_t, FloatArray>&, const std::array<float, 2>&, bool>(),
             py::arg("textures"), py::arg("compiled_material"),
             py::arg("shading_normal") = std::array<float, 3>{0, 0, 1},
             py::arg("geometric_normal") = std::array<float, 3>{0, 0, 1},
             py::arg("tangent") = std::array<float, 3>{0, 0, 0},
             py::arg("primvars") = std::map<uint32_t, FloatArray>{},
             py::arg("barycentrics") = std::array<float, 2>{0, 0}, py::arg("mirrored") = false)
        .def("evaluate", &ClosureProbe::evaluate, py::arg("to_light"), py::arg("to_eye"),
             py::arg("component") = 0, "f(to_light → to_eye), (n, 3).")
        .def("pdf", &ClosureProbe::pdf, py::arg("known"), py::arg("sampled"), py::arg("role"),
             py::arg("component") = 0, "Density of `sampled` in solid angle, (n,).")
        .def("sample", &ClosureProbe::sample, py::arg("known"), py::arg("role"), py::arg("u_lobe"),
             py::arg("u"), "(directions, values, pdfs, components, valid).")
        .def("eta_of_side", &ClosureProbe::eta_of_side, py::arg("directions"), py::arg("component"))
        .def_property_readonly("emission", &ClosureProbe::emitted)
        .def_property_readonly("emission_alone", &ClosureProbe::emission_alone)
        .def_property_readonly("opacity", &ClosureProbe::opacity_here)
        .def_property_readonly("has_non_delta", &ClosureProbe::has_non_delta)
        .def_property_readonly("is_emissive", &ClosureProbe::emissive)
        .def_property_readonly("is_opaque", &ClosureProbe::opaque)
        .def_property_readonly("shading_normal", &ClosureProbe::shading_normal)
        .def_property_readonly("shading_tangent", &ClosureProbe::shading_tangent)
        .def_property_readonly("lobes", &ClosureProbe::lobes);
}

}  // namespace usdmlt
