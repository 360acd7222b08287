#include "python/bind_lights.hpp"

#include <pybind11/numpy.h>

#include <optional>
#include <stdexcept>
#include <string>

namespace py = pybind11;

namespace usdmlt {

namespace {

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

Spectrum color_of(const py::handle& value) {
    const auto [r, g, b] = py::cast<std::tuple<float, float, float>>(value);
    return {r, g, b};
}

std::vector<float> floats_of(const py::handle& array, float factor) {
    const auto a = py::cast<DoubleArray>(array);
    std::vector<float> out;
    for (py::ssize_t i = 0; i < a.size(); ++i)
        out.push_back(static_cast<float>(a.data()[i] * factor));
    return out;
}

IesProfile profile_of(const py::handle& source) {
    IesProfile profile;
    profile.theta = floats_of(source.attr("vertical_degrees"), pi / 180);
    profile.phi = floats_of(source.attr("horizontal_degrees"), pi / 180);
    profile.values = floats_of(source.attr("factors"), 1);
    if (profile.theta.empty() || profile.values.size() != profile.theta.size() * profile.phi.size())
        throw std::invalid_argument("the profile's factors do not match its angles");
    return profile;
}

std::optional<ShapingParameters> shaping_of(const py::handle& light) {
    const py::object shaping = light.attr("shaping");
    if (shaping.is_none()) return std::nullopt;
    ShapingParameters parameters;
    parameters.focus = py::cast<float>(shaping.attr("focus"));
    parameters.focus_tint = color_of(shaping.attr("focus_tint"));
    parameters.cone_angle_degrees = py::cast<float>(shaping.attr("cone_angle_degrees"));
    parameters.cone_softness = py::cast<float>(shaping.attr("cone_softness"));
    const py::object profile = shaping.attr("ies");
    if (!profile.is_none()) parameters.profile = profile_of(profile);
    return parameters;
}

const Texture* texture_of(const py::handle& light, const std::vector<Texture>& textures) {
    const py::object index = light.attr("texture");
    if (index.is_none()) return nullptr;
    const auto i = py::cast<size_t>(index);
    if (i >= textures.size()) throw std::invalid_argument("no such texture");
    return textures[i].width > 0 && textures[i].height > 0 ? &textures[i] : nullptr;
}

uint32_t add_from_python(Lights& lights, const py::handle& light, Vec3d center,
                         const std::vector<Texture>& textures) {
    const auto family = py::cast<std::string>(py::type::handle_of(light).attr("__name__"));
    const auto number = [&](const char* name) { return py::cast<float>(light.attr(name)); };
    const Affine3f transform = recentred_transform(light, center);
    const Spectrum radiance = color_of(light.attr("radiance"));
    if (family == "DistantLight")
        return add_distant(lights, transform, number("angle_degrees"), radiance);
    if (family == "DomeLight")
        return add_dome(lights, transform, radiance, texture_of(light, textures));
    const auto parameters = shaping_of(light);
    const ShapingParameters* shaping = parameters ? &*parameters : nullptr;
    if (family == "RectLight")
        return add_rect(lights, transform, number("width"), number("height"), radiance,
                        texture_of(light, textures), shaping);
    if (family == "DiskLight")
        return add_disk(lights, transform, number("radius"), radiance, shaping);
    if (family == "SphereLight")
        return add_sphere(lights, transform, number("radius"), radiance, shaping);
    if (family == "CylinderLight")
        return add_cylinder(lights, transform, number("radius"), number("length"), radiance,
                            shaping);
    throw std::invalid_argument("not a light: " + family);
}

Affine3f recentred(const py::handle& matrix, Vec3d center) {
    const auto m = py::cast<DoubleArray>(matrix);
    if (m.ndim() != 2 || m.shape(0) != 4 || m.shape(1) != 4)
        throw std::invalid_argument("transform is not a 4x4 matrix");
    const auto row = [&](int i) { return Vec3d{m.at(i, 0), m.at(i, 1), m.at(i, 2)}; };
    return {to_float(row(0)), to_float(row(1)), to_float(row(2)), to_float(row(3) - center)};
}

}  // namespace

Affine3f recentred_transform(const py::handle& object, Vec3d center) {
    return recentred(object.attr("transform"), center);
}

Lights lights_from_python(const py::list& lights, Vec3d center,
                          const std::vector<Texture>& textures) {
    Lights result;
    for (const py::handle light : lights) {
        try {
            const uint32_t index = add_from_python(result, light, center, textures);
            std::vector<Affine3f> later;
            for (const auto& step : py::cast<py::list>(light.attr("motion")))
                later.push_back(recentred(step, center));
            set_motion(result, index, recentred_transform(light, center), later);
        } catch (const std::invalid_argument& error) {
            const auto name = py::cast<std::string>(py::getattr(light, "name", py::str("")));
            throw std::invalid_argument(name + ": " + error.what());
        }
    }
    return result;
}

}  // namespace usdmlt
