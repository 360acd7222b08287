#include "integrators/bootstrap.hpp"

#include <algorithm>
#include <tuple>

namespace usdmlt {
namespace {

constexpr int stratified_pairs = 12;  // of each of the two subpaths

uint32_t spread_bits(uint32_t x) {
    x &= 0xffff;
    x = (x | x << 8) & 0x00ff00ffu;
    x = (x | x << 4) & 0x0f0f0f0fu;
    x = (x | x << 2) & 0x33333333u;
    return (x | x << 1) & 0x55555555u;
}

// 6 bits of length, 26 of class (the vertices nearest to the eye if there are more), 32 of place.
uint64_t sort_key(const StrategySample& sample, const RasterDomain& domain, Vec2f raster) {
    uint64_t bits = 0;
    for (int i = 1; i < sample.t - 1; ++i)
        bits = bits << 1 | (sample.camera[i].component != non_delta);
    // The joined vertices, where they are not an end of the path.
    if (sample.t > 1 && sample.s > 0) bits <<= 1;
    if (sample.s > 1) bits <<= 1;
    for (int i = sample.s - 2; i > 0; --i)
        bits = bits << 1 | (sample.light[i].component != non_delta);
    const auto cell = [](float p, float lower, float upper) {
        return static_cast<uint32_t>(std::clamp((p - lower) / (upper - lower), 0.0f, 0.99999f) *
                                     0x1p16f);
    };
    const uint32_t place = spread_bits(cell(raster.x, domain.lower.x, domain.upper.x)) |
                           spread_bits(cell(raster.y, domain.lower.y, domain.upper.y)) << 1;
    return uint64_t(std::min(sample.edges(), 63)) << 58 | (bits & 0x3ffffff) << 32 | place;
}

double target_of(const Spectrum& value) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += target_weights[c] * std::fabs(value[c]);
    return sum;
}

// Weights, of all strategies of one sample.
struct EntrySink {
    const RasterDomain& domain;
    const ImportanceMap& importance;
    std::vector<BootstrapEntry>& entries;
    uint32_t index = 0;
    Vec2f raster, splat;
    double sum = 0;

    bool place(Vec2f p, Sampler&) {
        splat = p;
        return domain.contains(p);
    }
    void add(const StrategySample& sample) {
        const Vec2f p = sample.t == 1 ? splat : raster;
        const double v = target_of(sample.value) * importance.weight(p) /
                         (sample.t == 1 ? 1 : domain.density_scale());
        if (!(v > 0) || !std::isfinite(v)) return;
        sum += v;
        entries.push_back({sort_key(sample, domain, p), v, index, static_cast<uint16_t>(sample.s),
                           static_cast<uint16_t>(sample.t)});
    }
};

// The path of one strategy.
struct PathSink {
    const RasterDomain& domain;
    int s, t;
    Path& path;  // its vertices stay the scratch's
    VertexArena& arena;
    Vec2f raster, splat;
    bool found = false;

    bool place(Vec2f p, Sampler&) {
        splat = p;
        return domain.contains(p);
    }
    void add(const StrategySample& sample) {
        if (sample.s != s || sample.t != t) return;
        found = true;
        join_subpaths(sample.light, s, sample.camera, t, sample.edge, path);
        path.raster = t == 1 ? splat : raster;
        for (PathVertex& v : path.vertices) {
            Vertex* copy = arena.take();
            *copy = *v.vertex;
            v.vertex = copy;
        }
    }
};

}  // namespace

Bootstrap::Bootstrap(const Scene& scene, const Settings& settings, MutationContext& context,
                     const ImportanceMap& importance)
    : scene_(scene),
      settings_(settings),
      context_(context),
      importance_(importance),
      scratch_(settings.depth) {}

template <typename Sink>
void Bootstrap::sample(uint32_t index, Sink& sink, UnitStatistics& statistics, Vec2f& raster) {
    Sampler camera_sampler(key_, index, stratified_pairs);
    Sampler light_sampler(hash_key(key_, 1), index, stratified_pairs);
    raster = context_.domain.sample(camera_sampler.next_2d());
    StrategySampler(scene_, settings_, scratch_, statistics, sink)
        .sample(camera_sampler, light_sampler, raster);
}

double Bootstrap::draw(uint64_t key, uint32_t count, UnitStatistics& statistics) {
    key_ = key;
    entries_.clear();
    total_ = 0;
    EntrySink sink{context_.domain, importance_, entries_, 0, {}, {}, 0};
    for (uint32_t i = 0; i < count; ++i) {
        sink.index = i;
        sink.sum = 0;
        sample(i, sink, statistics, sink.raster);
        total_ += sink.sum;
    }
    return total_ / count;
}

void Bootstrap::choose_starts(int count, double u, std::vector<size_t>& starts) {
    std::sort(entries_.begin(), entries_.end(), [](const auto& a, const auto& b) {
        return std::tie(a.key, a.sample, a.s) < std::tie(b.key, b.sample, b.s);
    });
    starts.clear();
    double cumulative = 0;
    size_t i = 0;
    for (int c = 0; c < count; ++c) {
        const double position = (c + u) / count * total_;
        while (i + 1 < entries_.size() && cumulative + entries_[i].weight <= position)
            cumulative += entries_[i++].weight;
        starts.push_back(i);
    }
}

bool Bootstrap::restore(const BootstrapEntry& entry, PathTarget& target, PathState& state,
                        UnitStatistics& statistics) {
    PathSink sink{context_.domain, entry.s, entry.t, state.path, context_.arena, {}, {}, false};
    sample(entry.sample, sink, statistics, sink.raster);
    if (!sink.found) return false;
    const int k = state.path.edges();
    if (update_scattering(scene_, state.path, 0, k) && target.evaluate(state)) return true;
    context_.arena.give_all(state.path);
    return false;
}

}  // namespace usdmlt
