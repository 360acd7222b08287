#include "integrators/bidirectional.hpp"

namespace usdmlt {
namespace {

constexpr int stratified_pairs = 12;  // of each of the two subpaths

// Adds to the sample's own pixel, and splats what light subpaths reach.
struct FilmSink {
    const PixelFilter& filter;
    float reduction;
    Film& film;
    UnitSplats& unit;
    LayerScratch* layers;  // null: the film has none
    Spectrum sum;
    int x = 0, y = 0;  // of the splat

    bool wants(int, int) const { return true; }
    bool place(Vec2f raster, Sampler& sampler) {
        Vec2f offset;
        if (filter.kind != PixelFilter::Kind::box) offset = filter.offset(sampler.next_2d());
        const float px = std::floor((raster.x - offset.x) / reduction);
        const float py = std::floor((raster.y - offset.y) / reduction);
        if (!(px >= 0 && py >= 0 && px < float(film.width()) && py < float(film.height())))
            return false;
        x = static_cast<int>(px);
        y = static_cast<int>(py);
        return true;
    }
    void glow(const Subpath& camera, int edges, const Spectrum& value) {
        if (layers) add_glow_to_layers(camera, edges, value, layers->classes, layers->sample);
        sum += value;
    }
    void add(const StrategySample& sample) {
        const bool splats = sample.t == 1;
        LayerSums* parts = layers ? &(splats ? layers->splat : layers->sample) : nullptr;
        if (parts) {
            if (splats) parts->clear();
            add_to_layers(sample, sample.value, layers->classes, *parts);
        }
        if (splats)
            film.add_splat(x, y, sample.value, unit, parts);
        else
            sum += sample.value;
    }
};

}  // namespace

void render_bidirectional_unit(const Scene& scene, const Settings& settings, const Tiles& tiles,
                               int64_t index, StrategyScratch& scratch, LayerScratch* layers,
                               Film& film, UnitSplats& splats, UnitStatistics& statistics) {
    const Tiles::Unit unit = tiles.unit(index);
    FilmSink sink{settings.filter, float(settings.reduction), film, splats, layers, {}};
    StrategySampler sampler(scene, settings, scratch, statistics, sink);
    for (int y = unit.y0; y < unit.y1; ++y)
        for (int x = unit.x0; x < unit.x1; ++x) {
            const uint64_t pixel = uint64_t(y) * uint64_t(tiles.width) + uint64_t(x);
            const uint64_t key = hash_key(settings.seed, pixel);
            Sampler camera_sampler(key, unit.pass, stratified_pairs);
            Sampler light_sampler(hash_key(key, 1), unit.pass, stratified_pairs);
            const Vec2f raster = settings.sample_pixel(x, y, camera_sampler);
            sink.sum = {};
            if (layers) layers->sample.clear();
            sampler.sample(camera_sampler, light_sampler, raster);
            const bool covered = scratch.camera.count > 1 && scratch.camera[1].can_scatter();
            ++statistics.samples;
            const double sum[4] = {sink.sum[0], sink.sum[1], sink.sum[2], covered ? 1.0 : 0.0};
            film.add_sample(x, y, sum, layers ? &layers->sample : nullptr);
        }
}

}  // namespace usdmlt
