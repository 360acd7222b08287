#include "python/media_from_python.hpp"

#include <pybind11/stl.h>

#include "python/placed_arrays.hpp"

namespace usdmlt {
namespace {

Spectrum color(const py::handle& values) {
    const auto c = py::cast<std::array<float, 3>>(values);
    return {c[0], c[1], c[2]};
}

DensityGrid make_grid(const py::handle& source, Vec3d center) {
    DensityGrid grid;
    const auto values = py::cast<Floats>(source.attr("values"));
    for (size_t axis = 0; axis < 3; ++axis)
        grid.size[axis] = static_cast<int>(values.shape(py::ssize_t(axis)));
    const auto copy = [&](const Floats& from, int width, std::vector<float>& to) {
        to.resize(static_cast<size_t>(values.size() * width));
        const float* p = from.data();
        for (int x = 0; x < grid.size[0]; ++x)
            for (int y = 0; y < grid.size[1]; ++y)
                for (int z = 0; z < grid.size[2]; ++z)
                    for (int c = 0; c < width; ++c)
                        to[grid.index(x, y, z) * size_t(width) + size_t(c)] = *p++;
    };
    copy(values, 1, grid.values);
    if (!source.attr("emission").is_none())
        copy(py::cast<Floats>(source.attr("emission")), 3, grid.emission);
    // Cells in the scene; their centres have whole numbers.
    const Affine3d m = affine(source.attr("transform"));
    const auto lower = py::cast<std::array<double, 3>>(source.attr("lower"));
    const auto upper = py::cast<std::array<double, 3>>(source.attr("upper"));
    Affine3d cells;
    cells.x = m.x * ((upper[0] - lower[0]) / grid.size[0]);
    cells.y = m.y * ((upper[1] - lower[1]) / grid.size[1]);
    cells.z = m.z * ((upper[2] - lower[2]) / grid.size[2]);
    cells.origin =
        m.point({lower[0], lower[1], lower[2]}) + (cells.x + cells.y + cells.z) * 0.5 - center;
    grid.to_grid = cells.inverse();
    return grid;
}

// Of a mesh whose surface refracts, else 1.
float ior_of(const Scene& scene, const Mesh& mesh) {
    const Material& material = scene.materials.materials[mesh.material_of(0)];
    if (material.thin_walled) return 1;
    Closure closure;
    closure.geometric_normal = {0, 0, 1};
    closure.shading = Frame::from_normal({0, 0, 1});
    evaluate_material(scene.materials, mesh.material_of(0), mesh, 0, 1.0f / 3, 1.0f / 3, {},
                      closure);
    for (int i = 0; i < closure.lobe_count; ++i)
        if (closure.lobes[i].is_interface && closure.lobes[i].transmits)
            return closure.lobes[i].eta;
    return 1;
}

}  // namespace

void add_media(const py::object& source, Vec3d center, Scene& scene) {
    const Affine3d identity = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
    Media& media = scene.media;
    for (const auto& entry : py::cast<py::list>(source.attr("media"))) {
        Medium medium;
        medium.name = py::cast<std::string>(entry.attr("name"));
        medium.scattering = color(entry.attr("scattering"));
        medium.absorption = color(entry.attr("absorption"));
        medium.emission = color(entry.attr("emission"));
        medium.phase.g = py::cast<float>(entry.attr("anisotropy"));
        if (py::cast<std::string>(entry.attr("phase")) == "rayleigh")
            medium.phase.kind = PhaseKind::rayleigh;
        if (!entry.attr("grid").is_none()) medium.grid = make_grid(entry.attr("grid"), center);
        media.media.push_back(std::move(medium));
    }
    if (media.empty()) return;
    if (!source.attr("world_medium").is_none())
        media.world = py::cast<uint32_t>(source.attr("world_medium"));
    const auto add = [&](const py::handle& mesh, const Affine3d& m,
                         const std::vector<Affine3d>& steps, uint32_t index, uint32_t instance) {
        if (mesh.attr("medium").is_none()) return;
        const auto number = static_cast<uint32_t>(media.bodies.size());
        media.bodies.push_back(
            {py::cast<uint32_t>(mesh.attr("medium")), py::cast<int>(mesh.attr("medium_priority"))});
        media.nested = media.nested || media.bodies.back().priority != 0;
        if (index != invalid_index) {
            media.body_of_surface[Media::surface_key(index, instance)] = number;
            media.bodies.back().ior = ior_of(scene, scene.meshes[index]);
        }
        const Affine3d own = affine(mesh.attr("transform"));
        const auto points = py::cast<Floats>(mesh.attr("points"));
        Mesh boundary;
        boundary.name = py::cast<std::string>(mesh.attr("name"));
        boundary.positions = placed_points(points, own.then(m), center);
        boundary.triangles = triangles_of(py::cast<Indices>(mesh.attr("triangles")), false);
        for (const Affine3d& step : steps)
            boundary.later_positions.push_back(placed_points(points, own.then(step), center));
        // Of both motions that of the placement counts.
        if (steps.empty())
            for (const auto& step : py::cast<py::list>(mesh.attr("motion")))
                boundary.later_positions.push_back(
                    placed_points(py::cast<Floats>(step.attr("points")),
                                  affine(step.attr("transform")).then(m), center));
        media.boundaries.push_back(std::move(boundary));
    };
    uint32_t index = 0, placement = 0;
    for (const auto& mesh : py::cast<py::list>(source.attr("meshes")))
        add(mesh, identity, {}, index++, invalid_index);
    for (const auto& mesh : py::cast<py::list>(source.attr("volumes")))
        add(mesh, identity, {}, invalid_index, invalid_index);
    const auto prototypes = py::cast<py::list>(source.attr("prototypes"));
    for (const auto& entry : py::cast<py::list>(source.attr("instances"))) {
        const auto transforms = py::cast<Doubles>(entry.attr("transforms"));
        const auto motion = py::cast<Doubles>(entry.attr("motion"));
        const py::object prototype = prototypes[py::cast<size_t>(entry.attr("prototype"))];
        const py::ssize_t count = transforms.size() / 16;
        const MeshRange& range = scene.prototypes[py::cast<size_t>(entry.attr("prototype"))];
        if (range.count == 0) continue;
        for (py::ssize_t i = 0; i < count; ++i, ++placement) {
            std::vector<Affine3d> steps;
            index = range.first;
            for (py::ssize_t s = 0; s < motion.size() / (16 * count); ++s)
                steps.push_back(affine(motion.data() + 16 * (s * count + i)));
            for (const auto& mesh : py::cast<py::list>(prototype.attr("meshes")))
                add(mesh, affine(transforms.data() + 16 * i), steps, index++, placement);
        }
    }
}

}  // namespace usdmlt
