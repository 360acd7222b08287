#include "integrators/bootstrap.hpp"

#include <algorithm>
#include <tuple>

namespace usdmlt {
namespace {

constexpr int stratified_pairs = 12;  // of each of the two subpaths
// Entries below this part of a start's mean weight are kept by chance.
constexpr double least_weight = 0.01;

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

// Whether the path scatters at x_i by a Dirac component.
bool is_delta(const StrategySample& sample, int i) {
    if (i == sample.s - 1 || i == sample.s) return false;
    const SubpathVertex& v = i < sample.s ? sample.light[i] : sample.camera[sample.edges() - i];
    return v.component != non_delta;
}

uint64_t class_of(const StrategySample& sample) {
    return usdmlt::class_of(sample.edges(), [&](int i) {
        if (is_delta(sample, i)) return ClassLetter::S;
        const Vertex& v = i < sample.s ? sample.light[i] : sample.camera[sample.edges() - i];
        return v.is_medium() ? ClassLetter::M : ClassLetter::D;
    });
}

double survival(const StrategySample& sample) {
    return (sample.s > 0 ? sample.light[sample.s - 1].survival : 1.0) *
           sample.camera[sample.t - 1].survival;
}

// Weights, of all strategies of one sample.
struct EntrySink {
    const RasterDomain& domain;
    const ImportanceMap& importance;
    const Split& split;
    std::vector<BootstrapEntry>& entries;
    uint32_t number = 0, pass = 0;
    Vec2f raster{}, splat{};
    double sum = 0, least = 0;

    // What the split leaves; null: it is lost.
    const PathRecorder* recorder = nullptr;
    double splat_scale = 1;
    bool in_image = true;
    RandomStream random{0};
    Spectrum camera{};

    bool place(Vec2f p, Sampler&) {
        splat = p;
        return domain.contains(p);
    }
    bool wants(int, int) const { return true; }
    void add(const StrategySample& sample) {
        const bool splats = sample.t == 1;
        const Vec2f p = splats ? splat : raster;
        const double w = importance.weight(p), f = w * target_of(sample.value);
        if (!(f > 0) || !std::isfinite(f)) return;
        // Camera samples are one per pixel of the image, light subpaths one per sample, of which
        // some are of the margin.
        const double scale = splats ? domain.density_scale() : 1;
        // value = w f/(q_{s,t} p_{s,t}), and w = p_{s,t}²/Σp²: q_{s,t}, of this strategy, is not q.
        const double q = split.least_survival(
            rough_vertices(sample.edges(), [&](int i) { return is_delta(sample, i); }));
        const double of_chains = split.of_chains(sqr(f * survival(sample) / q) / sample.weight);
        if (recorder) record(sample, sample.value * static_cast<float>((1 - of_chains) * scale));
        double v = f * of_chains * scale;
        if (!(v > 0)) return;
        // Nearly all are that small where little is left to the chains, and they have to be sorted.
        if (v < least) {
            if (random.next_double() * least >= v) return;
            v = least;
        }
        sum += v;
        entries.push_back({sort_key(sample, domain, p), v, number, pass,
                           static_cast<uint16_t>(sample.s), static_cast<uint16_t>(sample.t)});
    }
    // Walks from the eye are the only ones that find it.
    void glow(const Subpath& path, int edges, const Spectrum& value) {
        if (!recorder || !in_image) return;
        if (recorder->layers)
            add_glow_to_layers(path, edges, value, recorder->layers->classes,
                               recorder->layers->sample);
        camera += value;
    }
    void record(const StrategySample& sample, const Spectrum& value) {
        LayerScratch* layers = recorder->layers;
        if (sample.t == 1) {
            const Spectrum scaled = value * static_cast<float>(splat_scale);
            if (layers) {
                layers->splat.clear();
                add_to_layers(sample, scaled, layers->classes, layers->splat);
            }
            recorder->splat(splat, scaled, class_of(sample), random);
        } else if (in_image) {
            camera += value;
            if (layers) add_to_layers(sample, value, layers->classes, layers->sample);
            recorder->classes->add(class_of(sample), luminance(value) * splat_scale);
        }
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
    bool wants(int of_light, int of_camera) const { return of_light == s && of_camera == t; }
    void glow(const Subpath&, int, const Spectrum&) {}
    void add(const StrategySample& sample) {
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
                     const ImportanceMap& importance, const Split& split, const PixelSubset& pixels)
    : scene_(scene),
      settings_(settings),
      context_(context),
      importance_(importance),
      split_(split),
      pixels_(pixels),
      scratch_(settings.depth) {
    // The split has to know from a path alone how bright its samples are.
    for (Subpath* path : {&scratch_.camera, &scratch_.light}) {
        path->roulette = !settings.selective;
        path->continuation.probability = split.continuation;
    }
}

double Bootstrap::fraction_going_on() const {
    const Continuation &camera = scratch_.camera.continuation, &light = scratch_.light.continuation;
    const double arrived = camera.arrived + light.arrived;
    return arrived > 0 ? (camera.went_on + light.went_on) / arrived : 1;
}

template <typename Sink>
bool Bootstrap::sample(uint32_t number, uint32_t pass, Sink& sink, UnitStatistics& statistics) {
    const uint64_t key = by_pixel_ ? hash_key(key_, number) : key_;
    const uint32_t index = by_pixel_ ? pass : number;
    Sampler camera_sampler(key, index, stratified_pairs);
    Sampler light_sampler(hash_key(key, 1), index, stratified_pairs);
    if (by_pixel_) {
        const PixelSubset::Place place = pixels_.place(number, pass);
        sink.raster = settings_.sample_pixel(place.x, place.y, camera_sampler);
        if (!context_.domain.contains(sink.raster)) return false;
    } else {
        sink.raster = context_.domain.sample(camera_sampler.next_2d());
    }
    StrategySampler(scene_, settings_, scratch_, statistics, sink)
        .sample(camera_sampler, light_sampler, sink.raster);
    return true;
}

double Bootstrap::draw(uint64_t key, uint32_t count, UnitStatistics& statistics) {
    begin_pixels(key, 0);
    by_pixel_ = false;
    EntrySink sink{context_.domain, importance_, split_, entries_};
    for (uint32_t i = 0; i < count; ++i) {
        sink.number = i;
        sink.sum = 0;
        sample(i, 0, sink, statistics);
        total_ += sink.sum;
    }
    return total_ / (count * context_.domain.density_scale());
}

void Bootstrap::begin_pixels(uint64_t key, int starts) {
    key_ = key;
    starts_ = starts;
    by_pixel_ = true;
    entries_.clear();
    total_ = 0;
}

CameraSample Bootstrap::add_pixel(const PixelSubset::Place& place, const PathRecorder& recorder,
                                  double splat_scale, UnitStatistics& statistics) {
    EntrySink sink{context_.domain, importance_, split_, entries_};
    sink.number = place.pixel;
    sink.pass = place.pass;
    sink.in_image = place.in_image;
    sink.recorder = &recorder;
    sink.splat_scale = splat_scale;
    sink.least = least_weight * total_ / starts_;
    sink.random = RandomStream(hash_key(hash_key(key_, 2 + uint64_t(place.pass)), place.pixel));
    if (!sample(place.pixel, place.pass, sink, statistics)) return {};
    total_ += sink.sum;
    return {sink.camera, scratch_.camera.count > 1 && scratch_.camera[1].can_scatter()};
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
    sample(entry.sample, entry.pass, sink, statistics);
    if (!sink.found) return false;
    const int k = state.path.edges();
    if (update_scattering(scene_, state.path, 0, k) && target.evaluate(state, 0, k)) return true;
    context_.arena.give_all(state.path);
    return false;
}

}  // namespace usdmlt
