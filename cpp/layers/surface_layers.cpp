#include "layers/surface_layers.hpp"

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>

#include "base/sampler.hpp"
#include "integrators/tiles.hpp"
#include "paths/trace.hpp"

namespace usdmlt {
namespace {

constexpr uint64_t stream = 0x6c6179657273;
constexpr int stratified_pairs = 4;  // pixel, filter, lens, time
constexpr float half_opaque = 0.5f;
constexpr float faintest = 1e-3f;  // what is left of the light where no one looks further

class ObjectNumbers {
public:
    explicit ObjectNumbers(const Scene& scene) : scene_(scene) {
        uint32_t next = scene.world_meshes;
        for (const Instance& instance : scene.instances) {
            first_.push_back(next);
            next += scene.prototypes[instance.prototype].count;
        }
        lights_ = next;
    }
    int32_t of(const Hit& hit) const {
        if (hit.mesh == invalid_index)
            return static_cast<int32_t>(lights_ + scene_.lights.shapes[hit.primitive]);
        if (hit.instance == invalid_index) return static_cast<int32_t>(hit.mesh);
        const uint32_t prototype = scene_.instances[hit.instance].prototype;
        return static_cast<int32_t>(first_[hit.instance] + hit.mesh -
                                    scene_.prototypes[prototype].first);
    }

private:
    const Scene& scene_;
    std::vector<uint32_t> first_;
    uint32_t lights_;
};

int32_t material_of(const Scene& scene, const Hit& hit) {
    if (hit.mesh == invalid_index) return -1;
    return static_cast<int32_t>(scene.meshes[hit.mesh].material_of(hit.primitive));
}

// Shares of one pixel, by what they are of.
struct Shares {
    std::vector<std::pair<int32_t, double>> of;

    void add(int32_t what, double share) {
        for (auto& [known, sum] : of)
            if (known == what) {
                sum += share;
                return;
            }
        of.emplace_back(what, share);
    }
    // The largest `ranks` of them.
    void take(int ranks, int32_t* what, float* coverage) {
        std::sort(of.begin(), of.end(), [](const auto& a, const auto& b) {
            return a.second != b.second ? a.second > b.second : a.first < b.first;
        });
        for (int i = 0; i < std::min(ranks, static_cast<int>(of.size())); ++i) {
            what[i] = of[size_t(i)].first;
            coverage[i] = static_cast<float>(of[size_t(i)].second);
        }
        of.clear();
    }
};

// Where a point of a surface is at a time.
Vec3f point_at(const Scene& scene, const Hit& hit, float time) {
    const Mesh& mesh = scene.meshes[hit.mesh];
    const Vec3f p = mesh.corner(hit.primitive, 0, time) * (1 - hit.u - hit.v) +
                    mesh.corner(hit.primitive, 1, time) * hit.u +
                    mesh.corner(hit.primitive, 2, time) * hit.v;
    return hit.instance == invalid_index ? p : scene.placement(hit.instance, time).point(p);
}

// Of what is at p when the shutter opens and at q when it closes.
Vec2f motion_of(const Camera& camera, Vec3f p, Vec3f q) {
    Vec2f before, after;
    Vec3f direction;
    if (!camera.project(p, camera.pose(0).position, 0, before, direction) ||
        !camera.project(q, camera.pose(1).position, 1, after, direction))
        return {};
    return {after.x - before.x, before.y - after.y};
}

class Pass {
public:
    Pass(const Scene& scene, const ObjectNumbers& numbers, const SurfaceLayersSettings& settings,
         SurfaceLayers& layers)
        : scene_(scene), numbers_(numbers), settings_(settings), layers_(layers) {}

    void centre(int x, int y, size_t pixel) {
        const Camera& camera = scene_.camera;
        const Vec3f lens = camera.pose(0).position;
        const CameraRay ray = camera.ray({float(x) + 0.5f, float(y) + 0.5f}, lens, 0);
        Surfaces surfaces(scene_, {ray.origin, ray.tnear, ray.direction, ray.tfar, 0});
        Hit hit;
        float opacity, passed = 1;
        do {
            if (!surfaces.next(hit, opacity)) return;
            passed *= 1 - opacity;
        } while (passed > half_opaque);

        const auto& asked = settings_;
        if (asked.objects) layers_.object[pixel] = numbers_.of(hit);
        if (asked.materials) layers_.material[pixel] = material_of(scene_, hit);
        if (asked.places) {
            layers_.triangle[pixel] = static_cast<int32_t>(hit.primitive);
            layers_.barycentrics[pixel] = {hit.u, hit.v};
        }
        surface_vertex(scene_, hit, vertex_);
        const Vec3f p = vertex_.position, normal = vertex_.normal;
        const bool from_behind = dot(normal, ray.direction) > 0;
        if (asked.positions) layers_.position[pixel] = to_float(to_double(p) + scene_.origin);
        if (asked.geometric_normals)
            layers_.geometric_normal[pixel] = from_behind ? -normal : normal;
        if (asked.shading_normals) {
            const Vec3f shading = vertex_.closure.shading.z;
            layers_.shading_normal[pixel] = from_behind ? -shading : shading;
        }
        if (asked.depths) layers_.depth[pixel] = dot(p - lens, camera.pose(0).forward);
        if (asked.motion && scene_.has_motion) {
            const bool moves = hit.mesh != invalid_index;
            layers_.motion[pixel] = motion_of(camera, p, moves ? point_at(scene_, hit, 1) : p);
        }
    }

    void averages(int x, int y, size_t pixel, int samples) {
        const uint64_t key = hash_key(stream, pixel);
        Spectrum albedo;
        for (int i = 0; i < samples; ++i) {
            Sampler sampler(key, static_cast<uint32_t>(i), stratified_pairs);
            add_sample(sampler, x, y, 1.0 / samples, albedo);
        }
        if (settings_.albedo) {
            albedo *= 1.0f / float(samples);
            layers_.albedo[pixel] = {albedo[0], albedo[1], albedo[2]};
        }
        if (!settings_.coverage) return;
        const size_t first = pixel * size_t(settings_.ranks);
        objects_.take(settings_.ranks, &layers_.covering_object[first],
                      &layers_.object_coverage[first]);
        materials_.take(settings_.ranks, &layers_.covering_material[first],
                        &layers_.material_coverage[first]);
    }

private:
    void add_sample(Sampler& sampler, int x, int y, double weight, Spectrum& albedo) {
        const Camera& camera = scene_.camera;
        Vec2f raster = Vec2f{float(x), float(y)} + sampler.next_2d();
        const Vec2f u_filter = sampler.next_2d(), u_lens = sampler.next_2d();
        raster = raster + settings_.filter.offset(u_filter);
        const float time = scene_.has_motion ? sampler.next_1d() : 0;
        const CameraRay ray = camera.ray(raster, camera.sample_lens(u_lens, time), time);
        Surfaces surfaces(scene_, {ray.origin, ray.tnear, ray.direction, ray.tfar, time});
        Hit hit;
        float opacity, passed = 1;
        while (passed > faintest && surfaces.next(hit, opacity)) {
            const float share = passed * opacity;
            passed *= 1 - opacity;
            const int32_t material = material_of(scene_, hit);
            if (settings_.coverage) {
                objects_.add(numbers_.of(hit), share * weight);
                if (material >= 0) materials_.add(material, share * weight);
            }
            if (settings_.albedo && material >= 0) {
                surface_vertex(scene_, hit, vertex_);
                albedo += vertex_.closure.albedo(-ray.direction) * share;
            }
        }
    }

    const Scene& scene_;
    const ObjectNumbers& numbers_;
    const SurfaceLayersSettings& settings_;
    SurfaceLayers& layers_;
    Vertex vertex_;
    Shares objects_, materials_;
};

SurfaceLayers empty_layers(const SurfaceLayersSettings& asked, size_t pixels) {
    SurfaceLayers layers;
    const auto make = [](auto& layer, bool wanted, size_t count, auto nothing) {
        if (wanted) layer.assign(count, nothing);
    };
    make(layers.object, asked.objects, pixels, -1);
    make(layers.material, asked.materials, pixels, -1);
    make(layers.triangle, asked.places, pixels, -1);
    make(layers.barycentrics, asked.places, pixels, Vec2f{});
    make(layers.position, asked.positions, pixels, Vec3f{});
    make(layers.shading_normal, asked.shading_normals, pixels, Vec3f{});
    make(layers.geometric_normal, asked.geometric_normals, pixels, Vec3f{});
    make(layers.depth, asked.depths, pixels, std::numeric_limits<float>::infinity());
    make(layers.motion, asked.motion, pixels, Vec2f{});
    make(layers.albedo, asked.albedo, pixels, Vec3f{});
    const size_t ranked = pixels * size_t(asked.ranks);
    make(layers.covering_object, asked.coverage, ranked, -1);
    make(layers.covering_material, asked.coverage, ranked, -1);
    make(layers.object_coverage, asked.coverage, ranked, 0.0f);
    make(layers.material_coverage, asked.coverage, ranked, 0.0f);
    return layers;
}

}  // namespace

SurfaceLayers surface_layers(const Scene& scene, const SurfaceLayersSettings& settings,
                             const RunLimits& limits) {
    const Tiles tiles(scene.camera.width, scene.camera.height);
    const ObjectNumbers numbers(scene);
    SurfaceLayers layers = empty_layers(settings, size_t(tiles.width) * size_t(tiles.height));
    std::atomic<bool> stopped{false};
    RunLimits to_the_end = limits;
    to_the_end.seconds = 0;
    to_the_end.poll = [&](int64_t done) {
        if (limits.poll && limits.poll(done)) stopped = true;
        return false;
    };
    std::vector<std::unique_ptr<Pass>> threads(static_cast<size_t>(limits.threads));
    run_units(0, tiles.count(), to_the_end, [&](int64_t index, int thread) {
        auto& pass = threads[static_cast<size_t>(thread)];
        if (!pass) pass = std::make_unique<Pass>(scene, numbers, settings, layers);
        const Tiles::Unit unit = tiles.unit(index);
        for (int y = unit.y0; y < unit.y1; ++y)
            for (int x = unit.x0; x < unit.x1; ++x) {
                const size_t pixel = size_t(y) * size_t(tiles.width) + size_t(x);
                if (settings.centre()) pass->centre(x, y, pixel);
                if (settings.averages())
                    pass->averages(x, y, pixel, stopped ? 1 : settings.samples);
            }
    });
    return layers;
}

}  // namespace usdmlt
