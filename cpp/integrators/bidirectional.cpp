#include "integrators/bidirectional.hpp"

#include "paths/connect.hpp"

namespace usdmlt {
namespace {

constexpr int stratified_pairs = 12;  // of each of the two subpaths

// One sample of the estimator Σ_{s,t} w_{s,t} C_{s,t}: what it adds to its own pixel, and splats.
class SampleEstimator {
public:
    SampleEstimator(const Scene& scene, const Settings& settings, BidirectionalScratch& scratch,
                    Film& film, UnitStatistics& statistics)
        : scene_(scene),
          settings_(settings),
          camera_(scratch.camera),
          light_(scratch.light),
          end_(scratch.end),
          film_(film),
          statistics_(statistics) {}

    Spectrum estimate(Sampler& camera_sampler, Sampler& light_sampler, Vec2f raster, float& alpha) {
        trace_camera_subpath(scene_, camera_sampler, raster, settings_.depth + 1, statistics_.rays,
                             camera_);
        trace_light_subpath(scene_, light_sampler, settings_.depth, statistics_.rays, light_);
        alpha = camera_.count > 1 && camera_[1].is_surface() ? 1 : 0;
        Spectrum sum;
        for (int t = 2; t <= camera_.count; ++t) {
            add(sum, hit_light(t), t - 1);
            if (!camera_[t - 1].is_surface() || !camera_[t - 1].can_connect()) continue;
            add(sum, next_event(camera_sampler, t), t);
            for (int s = 2; s <= light_.count && s + t - 1 <= settings_.depth; ++s)
                add(sum, connect(s, t), s + t - 1);
        }
        for (int s = 2; s <= light_.count && s <= settings_.depth; ++s)
            see_from_camera(light_sampler, s);
        return sum;
    }

private:
    void add(Spectrum& sum, const Spectrum& value, int edges) {
        if (is_black(value)) return;
        if (!is_finite(value)) {
            ++statistics_.non_finite;
            return;
        }
        sum += value;
        statistics_.energy[static_cast<size_t>(edges)] += luminance(value);
    }
    bool recorded(int edges) const {
        return edges >= settings_.min_edges && edges <= settings_.depth;
    }
    const SubpathVertex* before(const Subpath& path, int count) const {
        return count >= 2 ? &path[count - 2] : nullptr;
    }

    // s = 0
    Spectrum hit_light(int t) {
        const SubpathVertex& z = camera_[t - 1];
        if (!z.is_light || !recorded(t - 1)) return {};
        if (t == 2 && z.infinite && !settings_.background) return {};
        const Spectrum value = emitted_contribution(scene_, camera_, t);
        if (is_black(value)) return {};
        if (t == 2) return value;
        const SubpathVertex& previous = camera_[t - 2];
        const double w = strategy_weight(scene_, nullptr, nullptr, 0, z, &previous, t,
                                         light_densities(scene_, z, previous), 1);
        return value * static_cast<float>(w);
    }

    // s = 1
    Spectrum next_event(Sampler& sampler, int t) {
        if (!recorded(t)) return {};
        const SubpathVertex& z = camera_[t - 1];
        LightDensities densities;
        if (!sample_light(scene_, sampler, z, end_, densities.direct)) return {};
        const SubpathVertex& previous = camera_[t - 2];
        const Spectrum value = join(scene_, end_, nullptr, z, &previous);
        if (is_black(value)) return {};
        const float edge = transmittance(scene_, end_, z, statistics_.rays);
        if (edge == 0) return {};
        densities.point = pdf_point(scene_.lights, end_.light);
        const double w =
            strategy_weight(scene_, &end_, nullptr, 1, z, &previous, t, densities, edge);
        return value * static_cast<float>(edge * w);
    }

    Spectrum connect(int s, int t) {
        if (!recorded(s + t - 1)) return {};
        const SubpathVertex& x = light_[s - 1];
        const SubpathVertex& z = camera_[t - 1];
        if (!x.can_connect()) return {};
        const Spectrum value = join(scene_, x, before(light_, s), z, before(camera_, t));
        if (is_black(value)) return {};
        const float edge = transmittance(scene_, x, z, statistics_.rays);
        if (edge == 0) return {};
        const double w = strategy_weight(scene_, &x, before(light_, s), s, z, before(camera_, t), t,
                                         {light_.pdf_point, light_.pdf_direct}, edge);
        return value * static_cast<float>(edge * w);
    }

    // t = 1
    void see_from_camera(Sampler& sampler, int s) {
        if (!recorded(s)) return;
        const SubpathVertex& x = light_[s - 1];
        if (!x.can_connect()) return;
        const Camera& camera = scene_.camera;
        const Vec3f lens =
            camera.lens_radius > 0 ? camera.sample_lens(sampler.next_2d()) : camera.position;
        Vec2f raster;
        Vec3f direction;
        if (!camera.project(x.position, lens, raster, direction)) return;
        Vec2f offset;
        if (settings_.filter.kind != PixelFilter::Kind::box)
            offset = settings_.filter.offset(sampler.next_2d());
        const float px = std::floor(raster.x - offset.x), py = std::floor(raster.y - offset.y);
        if (!(px >= 0 && py >= 0 && px < float(film_.width()) && py < float(film_.height())))
            return;
        camera_vertex(scene_, lens, end_);
        end_.throughput = Spectrum(1.0f);
        const Spectrum value = join(scene_, x, &light_[s - 2], end_, nullptr);
        if (is_black(value)) return;
        const float edge = transmittance(scene_, x, end_, statistics_.rays);
        if (edge == 0) return;
        const double w = strategy_weight(scene_, &x, &light_[s - 2], s, end_, nullptr, 1,
                                         {light_.pdf_point, light_.pdf_direct}, edge);
        const Spectrum weighted = value * static_cast<float>(edge * w);
        if (!is_finite(weighted)) {
            ++statistics_.non_finite;
            return;
        }
        film_.add_splat(static_cast<int>(px), static_cast<int>(py), weighted);
        statistics_.energy[static_cast<size_t>(s)] += luminance(weighted);
    }

    const Scene& scene_;
    const Settings& settings_;
    Subpath& camera_;
    Subpath& light_;
    SubpathVertex& end_;
    Film& film_;
    UnitStatistics& statistics_;
};

}  // namespace

void render_bidirectional_unit(const Scene& scene, const Settings& settings, const Tiles& tiles,
                               int64_t index, BidirectionalScratch& scratch, Film& film,
                               UnitStatistics& statistics) {
    const Tiles::Unit unit = tiles.unit(index);
    SampleEstimator estimator(scene, settings, scratch, film, statistics);
    for (int y = unit.y0; y < unit.y1; ++y)
        for (int x = unit.x0; x < unit.x1; ++x) {
            const uint64_t pixel = uint64_t(y) * uint64_t(tiles.width) + uint64_t(x);
            const uint64_t key = hash_key(settings.seed, pixel);
            Sampler camera_sampler(key, unit.pass, stratified_pairs);
            Sampler light_sampler(hash_key(key, 1), unit.pass, stratified_pairs);
            const Vec2f jitter = camera_sampler.next_2d();
            Vec2f raster = Vec2f{float(x), float(y)} + jitter;
            if (settings.filter.kind != PixelFilter::Kind::box)
                raster = raster + settings.filter.offset(camera_sampler.next_2d());
            float alpha;
            const Spectrum value = estimator.estimate(camera_sampler, light_sampler, raster, alpha);
            ++statistics.samples;
            const double sum[4] = {value[0], value[1], value[2], alpha};
            film.add_samples(x, y, sum, 1);
        }
}

}  // namespace usdmlt
