#include "python/bind_scene.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <cmath>
#include <limits>

#include "base/floating_point.hpp"
#include "paths/trace.hpp"
#include "python/bind_lights.hpp"
#include "python/bind_materials.hpp"
#include "python/media_from_python.hpp"
#include "python/placed_arrays.hpp"
#include "scene/dirac_content.hpp"

namespace py = pybind11;

namespace usdmlt {
namespace {

struct BoundsD {
    Vec3d lower{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                std::numeric_limits<double>::infinity()};
    Vec3d upper{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
                -std::numeric_limits<double>::infinity()};

    void add(Vec3d p) {
        lower = {std::min(lower.x, p.x), std::min(lower.y, p.y), std::min(lower.z, p.z)};
        upper = {std::max(upper.x, p.x), std::max(upper.y, p.y), std::max(upper.z, p.z)};
    }
    void add(const BoundsD& b, const Affine3d& m) {
        if (b.empty()) return;
        for (int i = 0; i < 8; ++i)
            add(m.point({i & 1 ? b.upper.x : b.lower.x, i & 2 ? b.upper.y : b.lower.y,
                         i & 4 ? b.upper.z : b.lower.z}));
    }
    bool empty() const { return lower.x > upper.x; }
};

BoundsD points_bounds(const Floats& points) {
    BoundsD b;
    const float* p = points.data();
    for (py::ssize_t i = 0; i < points.shape(0); ++i) b.add({p[3 * i], p[3 * i + 1], p[3 * i + 2]});
    return b;
}

// `source` has points and a transform: a mesh, or one of its later steps.
BoundsD placed_bounds(const py::handle& source) {
    BoundsD b;
    b.add(points_bounds(py::cast<Floats>(source.attr("points"))), affine(source.attr("transform")));
    return b;
}

BoundsD mesh_bounds(const py::handle& mesh) {
    BoundsD b = placed_bounds(mesh);
    for (const auto& step : py::cast<py::list>(mesh.attr("motion")))
        b.add(placed_bounds(step), {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}});
    return b;
}

CornerValues corner_values(const py::handle& primvar, bool flipped) {
    CornerValues out;
    const auto values = py::cast<Floats>(primvar.attr("values"));
    out.width = values.ndim() == 1 ? 1 : static_cast<int>(values.shape(1));
    out.values = shared<float>(values);
    const py::object corners = primvar.attr("corners");
    if (!corners.is_none()) out.corners = triangles_of(py::cast<Indices>(corners), flipped);
    return out;
}

// Unit length in the mesh's own space, and only linear from there: interpolation then commutes with
// the transform, and a mesh looks the same placed directly or instanced.
void place_normals(const Affine3d& m, std::vector<float>& v) {
    const double volume = std::fabs(m.determinant());
    const double scale = volume > 0 ? std::pow(std::cbrt(volume), -2) : 1;
    for (size_t i = 0; i + 2 < v.size(); i += 3) {
        Vec3d n{v[i], v[i + 1], v[i + 2]};
        const double l = length(n);
        if (l > 0) n = m.normal(n) * (scale / l);
        v[i] = float(n.x);
        v[i + 1] = float(n.y);
        v[i + 2] = float(n.z);
    }
}

// Points and normals at the later times of the shutter's interval.
void add_motion(const py::handle& source, Vec3d center, Mesh& mesh) {
    for (const auto& step : py::cast<py::list>(source.attr("motion"))) {
        const Affine3d m = affine(step.attr("transform"));
        mesh.later_positions.push_back(
            placed_points(py::cast<Floats>(step.attr("points")), m, center));
        if (mesh.later_positions.back().size() != mesh.positions.size())
            throw std::invalid_argument(mesh.name + ": the number of points changes");
        if (mesh.normals.empty()) continue;
        const auto values = py::cast<Floats>(step.attr("normals"));
        mesh.later_normals.emplace_back(values.data(), values.data() + values.size());
        if (mesh.later_normals.back().size() != mesh.normals.values.size())
            throw std::invalid_argument(mesh.name + ": the number of normals changes");
        place_normals(m, mesh.later_normals.back());
    }
}

// A mesh with its transform applied; a mirroring transform swaps two corners of every triangle.
Mesh make_mesh(const py::handle& source, Vec3d center, const py::dict& primvar_slots) {
    Mesh mesh;
    mesh.name = py::cast<std::string>(source.attr("name"));
    mesh.one_sided = !py::cast<bool>(source.attr("double_sided"));
    const Affine3d m = affine(source.attr("transform"));
    const bool flipped = m.determinant() < 0;
    mesh.positions = placed_points(py::cast<Floats>(source.attr("points")), m, center);
    mesh.triangles = triangles_of(py::cast<Indices>(source.attr("triangles")), flipped);

    const py::object normals = source.attr("normals");
    if (!normals.is_none()) {
        mesh.normals = corner_values(normals, flipped);
        const SharedArray<float>& values = mesh.normals.values;
        std::vector<float> placed(values.data(), values.data() + values.size());
        place_normals(m, placed);
        mesh.normals.values = std::move(placed);
    }
    add_motion(source, center, mesh);
    const auto primvars = py::cast<py::dict>(source.attr("primvars"));
    for (const auto& item : primvar_slots) {
        if (!primvars.contains(item.first)) continue;
        const auto slot = py::cast<size_t>(item.second);
        if (mesh.primvars.size() <= slot) mesh.primvars.resize(slot + 1);
        mesh.primvars[slot] = corner_values(primvars[item.first], flipped);
    }
    const py::object materials = source.attr("materials");
    if (py::isinstance<py::array>(materials)) {
        const auto array = py::cast<Indices>(materials);
        mesh.triangle_materials = shared<uint32_t>(array);
    } else {
        mesh.material = py::cast<uint32_t>(materials);
    }
    return mesh;
}

// Orthonormal axes of a camera transform.
CameraPose camera_pose(const Affine3d& m, Vec3d center) {
    const Vec3f z = normalize(to_float(m.z));
    Vec3f x = to_float(m.x);
    x = normalize(x - z * dot(x, z));
    Vec3f y = cross(z, x);
    if (m.determinant() < 0) y = -y;
    return {to_float(m.origin - center), x, y, -z};
}

// `scale` is the uniform scale of the transform.
Camera make_camera(const py::handle& source, Vec3d center, int width, int height) {
    const Affine3d m = affine(source.attr("transform"));
    Camera camera;
    const double scale = std::cbrt(std::fabs(m.determinant()));
    camera.poses[0] = camera_pose(m, center);
    for (const auto& step : py::cast<py::list>(source.attr("motion")))
        camera.poses.push_back(camera_pose(affine(step), center));
    camera.width = width;
    camera.height = height;
    camera.orthographic = py::cast<std::string>(source.attr("projection")) == "orthographic";
    const auto window = py::cast<std::array<double, 4>>(source.attr("window"));
    const double unit = camera.orthographic ? scale : 1;
    camera.left = float(window[0] * unit);
    camera.top = float(window[3] * unit);
    camera.window_width = float((window[1] - window[0]) * unit);
    camera.window_height = float((window[3] - window[2]) * unit);
    if (!camera.orthographic) {
        camera.lens_radius = float(py::cast<double>(source.attr("lens_radius")) * scale);
        camera.focus_distance = float(py::cast<double>(source.attr("focus_distance")) * scale);
    }
    const auto clipping = py::cast<std::array<double, 2>>(source.attr("clipping"));
    camera.near = float(std::max(clipping[0] * scale, camera.orthographic ? -1e30 : 0.0));
    camera.far = float(std::min(clipping[1] * scale, double(infinite_distance)));
    const auto planes = py::cast<Doubles>(source.attr("clipping_planes"));
    const CameraPose& pose = camera.poses[0];
    for (py::ssize_t i = 0; i < planes.size() / 4; ++i) {
        const double* p = planes.data() + 4 * i;
        const Vec3f normal =
            pose.right * float(p[0]) + pose.up * float(p[1]) - pose.forward * float(p[2]);
        camera.clipping_planes.push_back(
            {normal, float(p[3] * scale - dot(to_double(normal), to_double(pose.position)))});
    }
    return camera;
}

// Of lights and meshes; nothing where no light is linked.
void add_light_links(const py::object& source, Scene& scene) {
    const py::object compiled =
        py::module_::import("usdmlt.light_links").attr("compile_light_links")(source);
    const auto members = py::cast<py::array_t<uint8_t>>(compiled.attr("members"));
    if (members.size() == 0) return;
    LightLinks& links = scene.lights.links;
    links.collections = static_cast<uint32_t>(members.shape(1));
    links.members.assign(members.data(), members.data() + members.size());
    const auto numbers = [&](const char* name) {
        const auto array = py::cast<Indices>(compiled.attr(name));
        return std::vector<uint32_t>(array.data(), array.data() + array.size());
    };
    links.of_light = numbers("of_light");
    const std::vector<uint32_t> of_mesh = numbers("of_mesh"), kind = numbers("kind_of_mesh");
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        scene.meshes[i].link = of_mesh[i];
        scene.meshes[i].receiver = kind[i];
    }
}

std::shared_ptr<Scene> make_scene(const py::object& source, const std::string& embree_library,
                                  const std::string& isa) {
    auto library = embree::load(embree_library);
    auto scene = std::make_shared<Scene>();

    const py::tuple compiled =
        py::module_::import("usdmlt.closures").attr("compile_materials")(source);
    const auto primvar_slots = py::cast<py::dict>(compiled[1]);
    scene->materials = materials_from_python(py::cast<py::list>(source.attr("textures")),
                                             py::cast<py::list>(compiled[0]));

    // Bounds in double, to recentre what is far from the origin.
    BoundsD bounds;
    const auto meshes = py::cast<py::list>(source.attr("meshes"));
    const auto prototypes = py::cast<py::list>(source.attr("prototypes"));
    const auto instances = py::cast<py::list>(source.attr("instances"));
    const Affine3d identity = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
    for (const auto& mesh : meshes) bounds.add(mesh_bounds(mesh), identity);
    std::vector<BoundsD> prototype_bounds;
    for (const auto& prototype : prototypes) {
        BoundsD b;
        for (const auto& mesh : py::cast<py::list>(prototype.attr("meshes")))
            b.add(mesh_bounds(mesh), identity);
        prototype_bounds.push_back(b);
    }
    for (const auto& entry : instances) {
        const auto transforms = py::cast<Doubles>(entry.attr("transforms"));
        const BoundsD& b = prototype_bounds.at(py::cast<size_t>(entry.attr("prototype")));
        for (py::ssize_t i = 0; i < transforms.size() / 16; ++i)
            bounds.add(b, affine(transforms.data() + 16 * i));
        const auto motion = py::cast<Doubles>(entry.attr("motion"));
        for (py::ssize_t i = 0; i < motion.size() / 16; ++i)
            bounds.add(b, affine(motion.data() + 16 * i));
    }
    if (bounds.empty()) bounds.add(affine(source.attr("camera").attr("transform")).origin);
    const Vec3d center = (bounds.lower + bounds.upper) * 0.5;
    // Near the origin nothing is gained, and coordinates stay as they were written.
    if (length(center) > 2 * length(bounds.upper - center)) scene->origin = center;
    const Vec3d origin = scene->origin;

    for (const auto& mesh : meshes) scene->meshes.push_back(make_mesh(mesh, origin, primvar_slots));
    scene->world_meshes = static_cast<uint32_t>(scene->meshes.size());
    for (const auto& prototype : prototypes) {
        MeshRange range{static_cast<uint32_t>(scene->meshes.size()), 0};
        for (const auto& mesh : py::cast<py::list>(prototype.attr("meshes"))) {
            scene->meshes.push_back(make_mesh(mesh, {}, primvar_slots));
            ++range.count;
        }
        scene->prototypes.push_back(range);
    }
    for (const auto& entry : instances) {
        const auto transforms = py::cast<Doubles>(entry.attr("transforms"));
        const auto prototype = py::cast<uint32_t>(entry.attr("prototype"));
        if (scene->prototypes.at(prototype).count == 0) continue;
        const py::ssize_t count = transforms.size() / 16;
        const auto motion = py::cast<Doubles>(entry.attr("motion"));
        if (motion.size() > 0 && (count == 0 || motion.size() % (16 * count) != 0))
            throw std::invalid_argument("instances: motion must be (steps, count, 4, 4)");
        const auto steps = static_cast<uint32_t>(count > 0 ? motion.size() / (16 * count) : 0);
        for (py::ssize_t i = 0; i < count; ++i) {
            scene->instances.push_back(
                {prototype, affine(transforms.data() + 16 * i).recentred(origin),
                 static_cast<uint32_t>(scene->instance_steps.size()), steps});
            for (uint32_t step = 0; step < steps; ++step)
                scene->instance_steps.push_back(
                    affine(motion.data() + 16 * (step * count + i)).recentred(origin));
        }
    }

    add_media(source, origin, *scene);
    scene->camera = make_camera(source.attr("camera"), origin, py::cast<int>(source.attr("width")),
                                py::cast<int>(source.attr("height")));
    scene->exposure = py::cast<double>(source.attr("camera").attr("exposure"));
    scene->background = py::cast<bool>(source.attr("background"));
    scene->lights = lights_from_python(py::cast<py::list>(source.attr("lights")), origin,
                                       scene->materials.textures);
    add_light_links(source, *scene);
    {
        const py::gil_scoped_release release;
        scene->commit(std::move(library), isa);
    }
    return scene;
}

// Closest hits for tests and layers: distance (inf: none), mesh, triangle, instance, normal, uv.
py::dict closest_hits(const Scene& scene, const Doubles& origins, const Doubles& directions,
                      float time) {
    const py::ssize_t n = origins.shape(0);
    py::array_t<float> distance(n), normal({n, py::ssize_t(3)}), uv({n, py::ssize_t(2)});
    py::array_t<int64_t> mesh(n), triangle(n), instance(n);
    const auto o = origins.unchecked<2>();
    const auto d = directions.unchecked<2>();
    const FlushDenormals flush;
    RayCounters counters;
    RandomStream random(0);
    for (py::ssize_t i = 0; i < n; ++i) {
        const Vec3d origin = Vec3d{o(i, 0), o(i, 1), o(i, 2)} - scene.origin;
        Hit hit;
        Vertex v;
        Edge edge;
        const Ray ray{to_float(origin),
                      0,
                      {float(d(i, 0)), float(d(i, 1)), float(d(i, 2))},
                      infinite_distance,
                      time};
        const bool found =
            trace(scene, ray, Known::eye, random, counters, hit, v.opacity, edge) == Met::surface;
        const auto id = [&](uint32_t x) { return found && x != invalid_index ? int64_t(x) : -1; };
        if (found) surface_vertex(scene, hit, v);
        distance.mutable_at(i) = found ? hit.t : std::numeric_limits<float>::infinity();
        mesh.mutable_at(i) = id(hit.mesh);
        triangle.mutable_at(i) = id(hit.primitive);
        instance.mutable_at(i) = id(hit.instance);
        uv.mutable_at(i, 0) = found ? v.uv.x : 0;
        uv.mutable_at(i, 1) = found ? v.uv.y : 0;
        const Vec3f shading = found ? v.closure.shading.z : Vec3f{};
        normal.mutable_at(i, 0) = shading.x;
        normal.mutable_at(i, 1) = shading.y;
        normal.mutable_at(i, 2) = shading.z;
    }
    py::dict out;
    out["distance"] = distance;
    out["mesh"] = mesh;
    out["triangle"] = triangle;
    out["instance"] = instance;
    out["normal"] = normal;
    out["uv"] = uv;
    return out;
}

}  // namespace

Mesh mesh_from_python(const py::handle& source, const py::dict& primvar_slots) {
    return make_mesh(source, {}, primvar_slots);
}

void bind_scene(py::module_& module) {
    py::class_<Scene, std::shared_ptr<Scene>>(module, "Scene")
        .def(py::init(&make_scene), py::arg("scene"), py::arg("embree_library"),
             py::arg("isa") = "avx2",
             "Builds the core scene from a usdmlt.scene.Scene. Raises RuntimeError or ValueError "
             "with one line.")
        .def_property_readonly("width", [](const Scene& s) { return s.camera.width; })
        .def_property_readonly("height", [](const Scene& s) { return s.camera.height; })
        .def_property_readonly("has_lights",
                               [](const Scene& s) { return !s.lights.empty() || s.media.emit(); })
        .def_property_readonly("dirac_lights", &dirac_lights,
                               "Indices of the lights of one exact direction.")
        .def_property_readonly("dirac_materials", &dirac_materials,
                               "Indices of the materials with a lobe without spread, as far as "
                               "meshes have them.")
        .def_property_readonly("has_motion", [](const Scene& s) { return s.has_motion; })
        .def("intersect", &closest_hits, py::arg("origins"), py::arg("directions"),
             py::arg("time") = 0,
             "Closest hits of rays, (n, 3) arrays in world space, at a time in [0, 1] of the "
             "shutter's interval: a dict of arrays. A light's own shape has mesh -1, its number as "
             "triangle, and its parameters as uv.");
}

}  // namespace usdmlt
