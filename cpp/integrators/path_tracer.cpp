#include "integrators/path_tracer.hpp"

#include <algorithm>

#include "integrators/equiangular.hpp"
#include "paths/connect.hpp"
#include "paths/densities.hpp"
#include "paths/emission.hpp"

namespace usdmlt {
namespace {

// Pairs of dimensions: the pixel, its filter and the lens, then those of each bounce. Where
// anything moves, time comes after the lens.
enum : int { camera_pairs = 3, light_pair = 0, direction_pair = 2, choice_pair, bounce_pairs };
// Bounces whose numbers are stratified: beyond, plain random numbers are as good and cheaper.
constexpr int stratified_pairs = camera_pairs + 4 * bounce_pairs;
// Edges before roulette starts.
constexpr int roulette_start = 1;

// Next-event estimation at z, weighted against BSDF sampling:
//     w = p_D² / (p_D² + p_B²),
// and, where z is a point of a medium, against equiangular sampling.
Spectrum direct_light(const Scene& scene, Sampler& sampler, const SubpathVertex& z,
                      const SubpathVertex& z_previous, const EquiangularRay& equiangular,
                      SubpathVertex& x0, RayCounters& counters) {
    double pdf_direct;
    if (!sample_light(scene, sampler, z.position, z.time, x0, pdf_direct)) return {};
    const Spectrum value = join(scene, x0, nullptr, z, &z_previous);
    if (is_black(value)) return {};
    const Edge edge = edge_between(scene, x0, z, counters);
    if (edge.is_blocked()) return {};
    double other = 0;
    if (!x0.light.delta) {
        const double pdf =
            density_by_scattering(z, z.to_previous, x0, direction_to(z, x0), Known::eye, edge);
        other = squared_ratio(pdf, pdf_direct);
    }
    if (z.is_medium())
        other += squared_ratio(equiangular.density(scene.lights, x0, z),
                               z.edge.media_from_eye * pdf_direct);
    return edge.through(value, 1 / (1 + other));
}

bool has_dirac(const Closure& closure) {
    return std::any_of(closure.lobes, closure.lobes + closure.lobe_count,
                       [](const Lobe& lobe) { return lobe.delta; });
}

}  // namespace

Spectrum trace_path(const Scene& scene, const Settings& settings, Sampler& sampler, Vec2f raster,
                    PathTracerScratch& scratch, UnitStatistics& statistics, float& alpha) {
    const Camera& camera = scene.camera;
    LayerScratch* const layers = scratch.layers;
    if (layers) layers->classes.begin();
    SubpathVertex* previous = &scratch.vertices[0];
    SubpathVertex* v = &scratch.vertices[1];
    SubpathVertex& x0 = scratch.vertices[2];
    SubpathVertex& scatters_once = scratch.vertices[3];
    const Vec2f u_lens = camera.lens_radius > 0 ? sampler.next_2d() : Vec2f{};
    const float time = sample_time(scene, sampler);
    const int first_pair = camera_pairs + (scene.has_motion ? 1 : 0);
    const Vec3f lens = camera.sample_lens(u_lens, time);
    camera_vertex(scene, lens, time, *previous);
    const CameraRay camera_ray = camera.ray(raster, lens, time);
    Ray ray{camera_ray.origin, camera_ray.tnear, camera_ray.direction, camera_ray.tfar, time};

    Spectrum radiance_sum, throughput(1.0f);
    double pdf = 0;          // of the ray's direction, by the BSDF
    Spectrum through_media;  // of the ray: transmittance over the probability of its end
    bool seen = true;        // by the eye, directly or through Dirac components
    // Of the edge before `previous`: rays whose reach is no matter of chance have a second way to
    // stop in media.
    EquiangularRay equiangular;
    float eta_squared = 1;  // of the medium the ray is in: what refraction took from the radiance
    alpha = 0;
    const auto record = [&](const Spectrum& value, int edges) {
        if (!is_finite(value)) {
            ++statistics.non_finite;
            return false;
        }
        radiance_sum += value;
        statistics.energy[static_cast<size_t>(edges)] += luminance(value);
        return layers && !is_black(value);
    };
    // Follows the ray, k-th edge of the path, to v; false where it meets nothing. What v and the
    // media before it emit goes to `end`, with all that scattering does to it on its way to the
    // eye.
    const auto follow = [&](const Spectrum& weight, int k, const auto& end) {
        statistics.rays.wants_glow = scene.media.emit();
        const Met met = trace_next(scene, *previous, ray, Known::eye, {}, sampler.stream(),
                                   statistics.rays, *v, v->edge);
        through_media = Spectrum(1.0f);
        if (!scene.media.empty()) [[unlikely]]
            through_media = v->edge.media_weight(Known::eye);
        if (scene.media.emit() && k >= settings.min_edges) [[unlikely]] {
            const Spectrum value = weight * statistics.rays.glow;
            if (record(value, k)) end(value, true);
        }
        if (met == Met::lost) return false;
        if (met != Met::nothing) {
            if (k == 1) alpha = 1;
        } else {
            LightPoint point;
            if (!environment_point(scene.lights, ray.direction, time, point)) return false;
            if (k == 1 && !settings.background) return false;
            light_vertex(scene, point, time, *v);
        }
        if (!v->is_light || k < settings.min_edges) return true;
        Spectrum value = weight * through_media * emission(scene, *v, *previous, -ray.direction);
        if (is_black(value)) return true;
        if (k > 1 && previous->component == non_delta) {
            const double p =
                area_density(pdf, *previous, *v, ray.direction) * v->edge.survival(Known::eye);
            const double direct = pdf_direct(scene.lights, v->light, previous->position);
            double others = squared_ratio(direct, p);
            if (previous->is_medium())
                others += squared_ratio(equiangular.density(scene.lights, *v, *previous),
                                        previous->edge.media_from_eye * p);
            value *= static_cast<float>(1 / (1 + others));
        }
        if (record(value, k)) [[unlikely]]
            end(value, false);
        return true;
    };
    for (int k = 1; k <= settings.depth; ++k) {
        const int pair = first_pair + (k - 1) * bounce_pairs;
        const bool met = follow(throughput, k, [&](const Spectrum& value, bool in_medium) {
            if (in_medium) return layers->classes.end_in_medium(value, layers->sample);
            layers->classes.end(*v, *previous, -ray.direction, value, layers->sample);
        });
        equiangular = {};
        if (seen && scene.all_whole && scene.media.scatter() && k < settings.depth &&
            k + 1 >= settings.min_edges) [[unlikely]] {
            Ray reach = ray;
            Hit hit;
            Edge edge;
            float opacity;
            if (met && v->is_surface())
                reach.tfar = length(v->position - ray.origin);
            else if (met && v->is_medium() &&
                     trace(scene, ray, Known::eye, sampler.stream(), statistics.rays, hit, opacity,
                           edge) == Met::surface)
                reach.tfar = hit.t;
            equiangular = EquiangularRay(*previous, reach);
            const Spectrum value =
                equiangular_light(scene, sampler.stream(), equiangular, *previous, reach,
                                  throughput, x0, scatters_once, statistics.rays);
            if (record(value, k + 1)) {
                const Vec3f from_light = direction_to(x0, scatters_once);
                layers->classes.scatter_and_end(
                    scattering_event(scatters_once, -from_light, -ray.direction, non_delta), x0,
                    scatters_once, from_light, value, layers->sample);
            }
        }
        if (!met) break;
        throughput *= through_media;
        if (v->infinite || v->closure.lobe_count == 0 || k == settings.depth) break;

        v->throughput = throughput;
        v->to_previous = -ray.direction;
        sampler.seek(pair + light_pair);
        if (v->closure.has_non_delta && k + 1 >= settings.min_edges) {
            const Spectrum value =
                direct_light(scene, sampler, *v, *previous, equiangular, x0, statistics.rays);
            if (record(value, k + 1)) [[unlikely]] {
                const Vec3f from_light = direction_to(x0, *v);
                layers->classes.scatter_and_end(
                    scattering_event(*v, -from_light, v->to_previous, non_delta), x0, *v,
                    from_light, value, layers->sample);
            }
        }

        const bool last = k + 1 == settings.depth;
        if (last && has_dirac(v->closure)) {
            // All of them, not one by chance: lamps seen in glass are bright and rarely met.
            std::swap(v, previous);
            for (int i = 0; i < previous->closure.lobe_count; ++i)
                for (const Component c : {delta_reflection(i), delta_transmission(i)}) {
                    Vec3f direction;
                    if (!previous->closure.delta_direction(previous->to_previous, c, direction))
                        continue;
                    const Spectrum scattered =
                        previous->closure.evaluate(direction, previous->to_previous, c) *
                        (abs_dot(direction, previous->closure.shading.z) /
                         previous->closure.delta_measure(direction, c));
                    if (is_black(scattered)) continue;
                    previous->component = c;
                    ray = {offset_origin(*previous, direction), 0, direction, infinite_distance,
                           time};
                    follow(throughput * scattered, k + 1,
                           [&](const Spectrum& value, bool in_medium) {
                               const ScatteringEvent event =
                                   scattering_event(*previous, direction, previous->to_previous, c);
                               if (in_medium)
                                   return layers->classes.scatter_and_end_in_medium(event, value,
                                                                                    layers->sample);
                               layers->classes.scatter_and_end(event, *v, *previous, -direction,
                                                               value, layers->sample);
                           });
                }
            std::swap(v, previous);
            if (!v->closure.has_non_delta) break;
        }

        sampler.seek(pair + direction_pair);
        const Vec2f u = sampler.next_2d();
        const bool roulette = k > roulette_start;
        const Vec2f choice = v->closure.is_lambert && !roulette ? Vec2f{} : sampler.next_2d();
        ClosureSample sample;
        if (!v->closure.sample(-ray.direction, Known::eye, choice.x, u, sample)) break;
        if (last && sample.component != non_delta) break;
        v->component = sample.component;
        seen = seen && sample.component != non_delta;
        if (layers) [[unlikely]]
            layers->classes.scatter(
                scattering_event(*v, sample.direction, v->to_previous, sample.component));
        throughput *= sampling_weight(*v, -ray.direction, Known::eye, sample);
        eta_squared *= refraction_scale(*v, v->to_previous, Known::eye, sample);
        const float w = max_component(throughput) * eta_squared;
        if (!(w > 0)) break;
        if (roulette) {
            const float q = continuation_probability(w);
            if (choice.y >= q) break;
            throughput *= 1 / q;
        }
        pdf = sample.pdf;
        ray = {offset_origin(*v, sample.direction), 0, sample.direction, infinite_distance, time};
        std::swap(v, previous);
    }
    return radiance_sum;
}

void render_path_unit(const Scene& scene, const Settings& settings, const Tiles& tiles,
                      int64_t index, PathTracerScratch& scratch, Film& film,
                      UnitStatistics& statistics) {
    const Tiles::Unit unit = tiles.unit(index);
    for (int y = unit.y0; y < unit.y1; ++y)
        for (int x = unit.x0; x < unit.x1; ++x) {
            const uint64_t pixel = uint64_t(y) * uint64_t(tiles.width) + uint64_t(x);
            Sampler sampler(hash_key(settings.seed, pixel), unit.pass, stratified_pairs);
            const Vec2f raster = settings.sample_pixel(x, y, sampler);
            float alpha;
            if (scratch.layers) scratch.layers->sample.clear();
            const Spectrum value =
                trace_path(scene, settings, sampler, raster, scratch, statistics, alpha);
            ++statistics.samples;
            const double sum[4] = {value[0], value[1], value[2], alpha};
            film.add_sample(x, y, sum, scratch.layers ? &scratch.layers->sample : nullptr);
        }
}

}  // namespace usdmlt
