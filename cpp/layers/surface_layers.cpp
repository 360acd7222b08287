#include "layers/surface_layers.hpp"

#include <algorithm>
#include <atomic>
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

// Shares of one pixel, by what they are of.
template <typename Key>
struct Shares {
    std::vector<std::pair<Key, double>> of;

    void add(const Key& key, double share) {
        for (auto& [known, sum] : of)
            if (known == key) {
                sum += share;
                return;
            }
        of.emplace_back(key, share);
    }
    // The largest `ranks` of them; with a few that are the same, the order is that of the keys.
    void take(int ranks, Key* keys, float* coverage) {
        std::sort(of.begin(), of.end(), [](const auto& a, const auto& b) {
            return a.second != b.second ? a.second > b.second : a.first < b.first;
        });
        for (int i = 0; i < std::min(ranks, static_cast<int>(of.size())); ++i) {
            keys[i] = of[size_t(i)].first;
            coverage[i] = static_cast<float>(of[size_t(i)].second);
        }
        of.clear();
    }
};

SurfaceKey key_of(const Scene& scene, const Hit& hit) {
    SurfaceKey key;
    if (hit.mesh == invalid_index) {
        key.light = scene.lights.shapes[hit.primitive];
        return key;
    }
    key.mesh = hit.mesh;
    key.instance = hit.instance;
    key.material = scene.meshes[hit.mesh].material_of(hit.primitive);
    return key;
}

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
    Pass(const Scene& scene, const SurfaceLayersSettings& settings, SurfaceLayers& layers)
        : scene_(scene), settings_(settings), layers_(layers) {}

    void centre(int x, int y, SurfaceAtCentre& out) {
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
        surface_vertex(scene_, hit, vertex_);
        out.key = key_of(scene_, hit);
        out.triangle = hit.primitive;
        out.barycentrics = {hit.u, hit.v};
        out.position = to_double(vertex_.position) + scene_.origin;
        const auto seen = [&](Vec3f n) { return dot(n, ray.direction) > 0 ? -n : n; };
        out.geometric_normal = seen(vertex_.normal);
        const Vec3f shading = vertex_.closure.shading.z;
        out.shading_normal = dot(vertex_.normal, ray.direction) > 0 ? -shading : shading;
        out.depth = dot(vertex_.position - lens, camera.pose(0).forward);
        if (!scene_.has_motion) return;
        const Vec3f p = vertex_.position;
        const bool moves = hit.mesh != invalid_index;
        out.motion = motion_of(camera, p, moves ? point_at(scene_, hit, 1) : p);
    }

    void averages(int x, int y, size_t pixel, int samples) {
        const uint64_t key = hash_key(stream, pixel);
        Spectrum albedo;
        for (int i = 0; i < samples; ++i) {
            Sampler sampler(key, static_cast<uint32_t>(i), stratified_pairs);
            add_sample(sampler, x, y, 1.0 / samples, albedo);
        }
        layers_.albedo[pixel] = albedo * (1.0f / float(samples));
        const auto ranks = size_t(settings_.ranks);
        objects_.take(settings_.ranks, &layers_.keys[pixel * ranks],
                      &layers_.coverage[pixel * ranks]);
        materials_.take(settings_.ranks, &layers_.material[pixel * ranks],
                        &layers_.material_coverage[pixel * ranks]);
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
            SurfaceKey surface = key_of(scene_, hit);
            if (surface.material != invalid_index) {
                materials_.add(surface.material, share * weight);
                surface_vertex(scene_, hit, vertex_);
                albedo += vertex_.closure.albedo(-ray.direction) * share;
            }
            surface.material = invalid_index;
            objects_.add(surface, share * weight);
        }
    }

    const Scene& scene_;
    const SurfaceLayersSettings& settings_;
    SurfaceLayers& layers_;
    Vertex vertex_;
    Shares<SurfaceKey> objects_;
    Shares<uint32_t> materials_;
};

}  // namespace

SurfaceLayers surface_layers(const Scene& scene, const SurfaceLayersSettings& settings,
                             const RunLimits& limits) {
    const Tiles tiles(scene.camera.width, scene.camera.height);
    const size_t pixels = size_t(tiles.width) * size_t(tiles.height);
    SurfaceLayers layers;
    layers.centre.resize(pixels);
    if (settings.samples > 0) {
        const size_t ranked = pixels * size_t(settings.ranks);
        layers.albedo.resize(pixels);
        layers.keys.resize(ranked);
        layers.coverage.resize(ranked);
        layers.material.assign(ranked, invalid_index);
        layers.material_coverage.resize(ranked);
    }
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
        if (!pass) pass = std::make_unique<Pass>(scene, settings, layers);
        const Tiles::Unit unit = tiles.unit(index);
        for (int y = unit.y0; y < unit.y1; ++y)
            for (int x = unit.x0; x < unit.x1; ++x) {
                const size_t pixel = size_t(y) * size_t(tiles.width) + size_t(x);
                pass->centre(x, y, layers.centre[pixel]);
                if (settings.samples > 0)
                    pass->averages(x, y, pixel, stopped ? 1 : settings.samples);
            }
    });
    return layers;
}

}  // namespace usdmlt
