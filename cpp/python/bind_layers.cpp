#include "python/bind_layers.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <set>

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

// Hands over a layer, unless it is empty.
template <typename To, typename From>
void put(py::dict& out, const char* name, std::vector<From>& layer) {
    if (layer.empty()) return;
    constexpr size_t width = sizeof(From) / sizeof(To);
    auto* kept = new std::vector<From>(std::move(layer));
    const py::capsule owner(kept, [](void* p) { delete static_cast<std::vector<From>*>(p); });
    out[name] = py::array_t<To>({kept->size(), width}, reinterpret_cast<To*>(kept->data()), owner);
}

py::dict surface_layers_of(const Scene& scene, const std::set<std::string>& asked,
                           const std::string& filter, int samples, int ranks, int threads,
                           const std::optional<py::function>& poll) {
    const auto wanted = [&](const char* name) { return asked.count(name) > 0; };
    SurfaceLayersSettings settings;
    settings.objects = wanted("object");
    settings.materials = wanted("material");
    settings.places = wanted("triangle");
    settings.positions = wanted("P");
    settings.shading_normals = wanted("N");
    settings.geometric_normals = wanted("Ng");
    settings.depths = wanted("Z");
    settings.motion = wanted("motionvector");
    settings.albedo = wanted("albedo");
    settings.coverage = wanted("coverage");
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
    py::dict out;
    put<int32_t>(out, "object", layers.object);
    put<int32_t>(out, "material", layers.material);
    put<int32_t>(out, "triangle", layers.triangle);
    put<float>(out, "barycentrics", layers.barycentrics);
    put<float>(out, "P", layers.position);
    put<float>(out, "N", layers.shading_normal);
    put<float>(out, "Ng", layers.geometric_normal);
    put<float>(out, "Z", layers.depth);
    put<float>(out, "motionvector", layers.motion);
    put<float>(out, "albedo", layers.albedo);
    put<int32_t>(out, "covering_object", layers.covering_object);
    put<int32_t>(out, "covering_material", layers.covering_material);
    put<float>(out, "object_coverage", layers.object_coverage);
    put<float>(out, "material_coverage", layers.material_coverage);
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
    automaton->kind_of_media = py::cast<int>(source.attr("of_media"));
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
    module.def("surface_layers", &surface_layers_of, py::arg("scene"), py::arg("asked"),
               py::kw_only(), py::arg("filter") = "gaussian", py::arg("samples") = 1,
               py::arg("ranks") = 1, py::arg("threads") = 1, py::arg("poll") = py::none(),
               "What the camera's rays meet: arrays (pixels, width) by the names that are asked "
               "for: object, material, triangle (and barycentrics), P, N, Ng, Z, motionvector; "
               "averages: albedo, and coverage, by pixel and rank. poll(tiles) true: the rest of "
               "the averages with a single sample.");
}

}  // namespace usdmlt
