#include "python/bind_layers.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <limits>

#include "layers/surface_layers.hpp"
#include "python/polling.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

template <typename T>
std::vector<T> vector_of(const py::handle& array) {
    const auto a = py::cast<py::array_t<T, py::array::c_style | py::array::forcecast>>(array);
    return std::vector<T>(a.data(), a.data() + a.size());
}

// (pixels, width) arrays of what `get` writes for each of `of`.
template <typename T, typename From, typename Get>
py::array_t<T> columns(const std::vector<From>& of, int width, const Get& get) {
    py::array_t<T> out({static_cast<py::ssize_t>(of.size()), static_cast<py::ssize_t>(width)});
    T* data = out.mutable_data();
    for (size_t i = 0; i < of.size(); ++i) get(of[i], data + i * size_t(width));
    return out;
}

// −1: none.
int64_t index_or_none(uint32_t index) { return index == invalid_index ? -1 : int64_t(index); }

// mesh, instance, light, material
py::array_t<int64_t> keys_of(const std::vector<SurfaceKey>& keys) {
    return columns<int64_t>(keys, 4, [](const SurfaceKey& key, int64_t* out) {
        out[0] = index_or_none(key.mesh);
        out[1] = index_or_none(key.instance);
        out[2] = index_or_none(key.light);
        out[3] = index_or_none(key.material);
    });
}

py::array_t<float> vectors_of(const std::vector<SurfaceAtCentre>& centre,
                              Vec3f SurfaceAtCentre::* member) {
    return columns<float>(centre, 3, [&](const SurfaceAtCentre& surface, float* out) {
        out[0] = (surface.*member).x;
        out[1] = (surface.*member).y;
        out[2] = (surface.*member).z;
    });
}

py::dict centre_of(const std::vector<SurfaceAtCentre>& centre) {
    using Surface = SurfaceAtCentre;
    std::vector<SurfaceKey> keys;
    for (const Surface& surface : centre) keys.push_back(surface.key);
    py::dict out;
    out["key"] = keys_of(keys);
    out["triangle"] = columns<int64_t>(
        centre, 1, [](const Surface& surface, int64_t* i) { *i = surface.triangle; });
    out["barycentrics"] = columns<float>(centre, 2, [](const Surface& surface, float* b) {
        b[0] = surface.barycentrics.x;
        b[1] = surface.barycentrics.y;
    });
    out["P"] = columns<double>(centre, 3, [](const Surface& surface, double* p) {
        p[0] = surface.position.x;
        p[1] = surface.position.y;
        p[2] = surface.position.z;
    });
    out["N"] = vectors_of(centre, &Surface::shading_normal);
    out["Ng"] = vectors_of(centre, &Surface::geometric_normal);
    out["Z"] = columns<float>(centre, 1, [](const Surface& surface, float* z) {
        *z = surface.key.exists() ? surface.depth : std::numeric_limits<float>::infinity();
    });
    out["motionvector"] = columns<float>(centre, 2, [](const Surface& surface, float* m) {
        m[0] = surface.motion.x;
        m[1] = surface.motion.y;
    });
    return out;
}

py::dict surface_layers_of(const Scene& scene, const std::string& filter, int samples, int ranks,
                           int threads, const std::optional<py::function>& poll) {
    SurfaceLayersSettings settings;
    if (filter == "box") settings.filter.kind = PixelFilter::Kind::box;
    settings.samples = samples;
    settings.ranks = ranks;
    Poll polling(poll);
    RunLimits limits;
    limits.threads = std::max(threads, 1);
    limits.poll = [&](int64_t done) { return polling(done); };
    SurfaceLayers layers;
    {
        const py::gil_scoped_release release;
        layers = surface_layers(scene, settings, limits);
    }
    polling.raise();
    py::dict out = centre_of(layers.centre);
    if (samples == 0) return out;
    out["albedo"] = columns<float>(layers.albedo, 3, [](const Spectrum& albedo, float* rgb) {
        std::copy_n(albedo.c, 3, rgb);
    });
    const auto one = [](float value, float* to) { *to = value; };
    out["object_key"] = keys_of(layers.keys);
    out["object_coverage"] = columns<float>(layers.coverage, 1, one);
    out["material_key"] = columns<int64_t>(layers.material, 1,
                                           [](uint32_t i, int64_t* to) { *to = index_or_none(i); });
    out["material_coverage"] = columns<float>(layers.material_coverage, 1, one);
    return out;
}

}  // namespace

std::shared_ptr<const LightPathAutomaton> automaton_from_python(const Scene& scene,
                                                                const py::object& source) {
    if (source.is_none()) return nullptr;
    auto automaton = std::make_shared<LightPathAutomaton>();
    automaton->layers = py::cast<int>(source.attr("layers"));
    if (automaton->layers < 1 || automaton->layers > most_layers)
        throw std::invalid_argument("there can be 1 to 64 layers of light paths");
    automaton->next = vector_of<uint16_t>(source.attr("next"));
    automaton->masks = vector_of<LayerMask>(source.attr("masks"));
    const size_t states = automaton->next.size() / LightPathAutomaton::scatterings;
    automaton->kinds =
        static_cast<int>(automaton->masks.size() / (states * LightPathAutomaton::terminals));

    const auto of_light = vector_of<uint16_t>(source.attr("of_light"));
    const auto of_mesh = vector_of<uint16_t>(source.attr("of_mesh"));
    const auto mesh_is_light = vector_of<uint8_t>(source.attr("mesh_is_light"));
    // The lights of meshes come after all others.
    for (size_t i = 0; i < scene.lights.lights.size(); ++i) {
        if (const auto* light = std::get_if<MeshLight>(&scene.lights.lights[i])) {
            const auto mesh = static_cast<size_t>(light->mesh - scene.meshes.data());
            automaton->labels.push_back({!mesh_is_light.at(mesh), of_mesh.at(mesh)});
        } else {
            automaton->labels.push_back({false, of_light.at(i)});
        }
    }
    return automaton;
}

void bind_layers(py::module_& module) {
    module.def("surface_layers", &surface_layers_of, py::arg("scene"), py::kw_only(),
               py::arg("filter") = "gaussian", py::arg("samples") = 0, py::arg("ranks") = 0,
               py::arg("threads") = 1, py::arg("poll") = py::none(),
               "What the camera's rays meet: arrays (pixels, …) by name. Of averages, `samples` > "
               "0, objects and materials by pixel and rank. poll(tiles) true: the rest with a "
               "single sample.");
}

}  // namespace usdmlt
