// One sample of bidirectional path tracing: every strategy (s, t) with t ≥ 1 that joins a light
// subpath and a camera subpath, with its weighted contribution w_{s,t} f / p_{s,t}.
//
// What becomes of the contributions is the caller's: a sink provides
//     bool place(raster, sampler)          t = 1 lands there: is it wanted? The sampler is the
//                                          light subpath's
//     bool wants(s, t)                     before what is dear: is this strategy needed?
//     void add(const StrategySample&)      finite and not black
//     void glow(camera, edges, value)      of media, on that edge of the camera subpath
#pragma once

#include "integrators/settings.hpp"
#include "integrators/statistics.hpp"
#include "paths/connect.hpp"

namespace usdmlt {

// Memory of one thread.
struct StrategyScratch {
    Subpath camera, light;
    Subpath end{1};  // x0 of next-event estimation, or the lens of t = 1

    explicit StrategyScratch(int depth) : camera(depth + 2), light(depth + 1) {}
};

struct StrategySample {
    int s, t;
    Spectrum value;
    double weight;          // w_{s,t}
    Edge edge;              // of the join
    const Subpath& light;   // `end` for s = 1
    const Subpath& camera;  // `end` for t = 1
    int edges() const { return s + t - 1; }
};

template <typename Sink>
class StrategySampler {
public:
    StrategySampler(const Scene& scene, const Settings& settings, StrategyScratch& scratch,
                    UnitStatistics& statistics, Sink& sink)
        : scene_(scene),
          settings_(settings),
          camera_(scratch.camera),
          light_(scratch.light),
          end_(scratch.end),
          statistics_(statistics),
          sink_(sink) {
        end_.count = 1;
    }

    void sample(Sampler& camera_sampler, Sampler& light_sampler, Vec2f raster) {
        const float time = sample_time(scene_, camera_sampler);
        trace_camera_subpath(scene_, camera_sampler, raster, time, settings_.depth + 1,
                             statistics_.rays, camera_);
        trace_light_subpath(scene_, light_sampler, time, settings_.depth, statistics_.rays, light_);
        for (int k = 1; k <= camera_.edges_with_glow; ++k)
            if (recorded(k)) glow(k, camera_.glow[static_cast<size_t>(k - 1)]);
        for (int t = 2; t <= camera_.count; ++t) {
            hit_light(t);
            if (!camera_[t - 1].can_scatter() || !camera_[t - 1].can_connect()) continue;
            next_event(camera_sampler, t);
            for (int s = 2; s <= light_.count && s + t - 1 <= settings_.depth; ++s) connect(s, t);
        }
        for (int s = 2; s <= light_.count && s <= settings_.depth; ++s)
            see_from_camera(light_sampler, s);
    }

private:
    void add(int s, int t, const Spectrum& value, double weight, const Edge& edge) {
        if (is_black(value)) return;
        if (!is_finite(value)) {
            ++statistics_.non_finite;
            return;
        }
        statistics_.energy[static_cast<size_t>(s + t - 1)] += luminance(value);
        sink_.add(StrategySample{s, t, value, weight, edge, s == 1 ? end_ : light_,
                                 t == 1 ? end_ : camera_});
    }
    void glow(int edges, const Spectrum& value) {
        if (is_black(value)) return;
        if (!is_finite(value)) {
            ++statistics_.non_finite;
            return;
        }
        statistics_.energy[static_cast<size_t>(edges)] += luminance(value);
        sink_.glow(camera_, edges, value);
    }
    bool recorded(int edges) const {
        return edges >= settings_.min_edges && edges <= settings_.depth;
    }
    const SubpathVertex* before(const Subpath& path, int count) const {
        return count >= 2 ? &path[count - 2] : nullptr;
    }

    // s = 0
    void hit_light(int t) {
        const SubpathVertex& z = camera_[t - 1];
        if (!z.is_light || !recorded(t - 1) || !sink_.wants(0, t)) return;
        if (t == 2 && z.infinite && !settings_.background) return;
        const Spectrum value = emitted_contribution(scene_, camera_, t);
        if (is_black(value)) return;
        if (t == 2) return add(0, t, value, 1, {});
        const SubpathVertex& previous = camera_[t - 2];
        const double w = strategy_weight(scene_, nullptr, nullptr, 0, z, &previous, t,
                                         light_densities(scene_, z, previous), {});
        add(0, t, value * static_cast<float>(w), w, {});
    }

    // s = 1
    void next_event(Sampler& sampler, int t) {
        if (!recorded(t)) return;
        const SubpathVertex& z = camera_[t - 1];
        LightDensities densities;
        if (!sample_light(scene_, sampler, z.position, z.time, end_[0], densities.direct)) return;
        if (!sink_.wants(1, t)) return;
        const SubpathVertex& previous = camera_[t - 2];
        const Spectrum value = join(scene_, end_[0], nullptr, z, &previous);
        if (is_black(value)) return;
        const Edge edge = edge_between(scene_, end_[0], z, statistics_.rays);
        if (edge.is_blocked()) return;
        densities.point = pdf_point(scene_.lights, end_[0].light);
        const double w =
            strategy_weight(scene_, &end_[0], nullptr, 1, z, &previous, t, densities, edge);
        add(1, t, edge.through(value, w), w, edge);
    }

    void connect(int s, int t) {
        if (!recorded(s + t - 1) || !sink_.wants(s, t)) return;
        const SubpathVertex& x = light_[s - 1];
        const SubpathVertex& z = camera_[t - 1];
        if (!x.can_connect()) return;
        const Spectrum value = join(scene_, x, before(light_, s), z, before(camera_, t));
        if (is_black(value)) return;
        const Edge edge = edge_between(scene_, x, z, statistics_.rays);
        if (edge.is_blocked()) return;
        const double w = strategy_weight(scene_, &x, before(light_, s), s, z, before(camera_, t), t,
                                         {light_.pdf_point, light_.pdf_direct}, edge);
        add(s, t, edge.through(value, w), w, edge);
    }

    // t = 1
    void see_from_camera(Sampler& sampler, int s) {
        if (!recorded(s)) return;
        const SubpathVertex& x = light_[s - 1];
        if (!x.can_connect()) return;
        const Camera& camera = scene_.camera;
        const Vec3f lens =
            camera.sample_lens(camera.lens_radius > 0 ? sampler.next_2d() : Vec2f{}, x.time);
        Vec2f raster;
        Vec3f direction;
        if (!camera.project(x.position, lens, x.time, raster, direction)) return;
        if (!sink_.place(raster, sampler) || !sink_.wants(s, 1)) return;
        camera_vertex(scene_, lens, x.time, end_[0]);
        end_[0].throughput = Spectrum(1.0f);
        const Spectrum value = join(scene_, x, &light_[s - 2], end_[0], nullptr);
        if (is_black(value)) return;
        const Edge edge = edge_between(scene_, x, end_[0], statistics_.rays);
        if (edge.is_blocked()) return;
        const double w = strategy_weight(scene_, &x, &light_[s - 2], s, end_[0], nullptr, 1,
                                         {light_.pdf_point, light_.pdf_direct}, edge);
        add(s, 1, edge.through(value, w), w, edge);
    }

    const Scene& scene_;
    const Settings& settings_;
    Subpath& camera_;
    Subpath& light_;
    Subpath& end_;
    UnitStatistics& statistics_;
    Sink& sink_;
};

}  // namespace usdmlt
